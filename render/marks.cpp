#include "render/marks.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

#include "render/layout.h"
#include "sim/gl/layout.h"

namespace tetpbd {

namespace {

constexpr glm::vec3 contact_colour(0.95f, 0.35f, 0.0f), worst_colour(0.70f, 0.0f, 0.30f);

// The size in pixels of a mark that has `size` in a picture of 720 lines.
float scaled(const Frame& frame, float size) { return size * std::max(1.0f, float(frame.viewport.height) / 720.0f); }

// Dots on vertices within 10^-5 of the size of the ground or a wall, as in metrics, seen through the bodies.
void draw_contacts(Renderer& renderer, const Frame& frame) {
  const Program& program = use(renderer, "contacts");
  program.set("colour", contact_colour);
  program.set("hole", 0.0f);
  program.set("size", scaled(frame, 7));
  program.set("touching", 1e-5f * glm::length(renderer.rest_high - renderer.rest_low));
  glDisable(GL_DEPTH_TEST);
  glDrawArrays(GL_POINTS, 0, GLsizei(renderer.mesh.positions.size()));
  glEnable(GL_DEPTH_TEST);
}

// Arrows at vertices and edges that touch another surface, along the normal away from it, and the redder the nearer
// they are; of the first pairs, where there are very many.
void draw_body_contacts(Renderer& renderer, const Frame& frame) {
  const Pairs& pairs = *frame.pairs;
  const float size = glm::length(renderer.rest_high - renderer.rest_low);
  constexpr std::size_t most = 65536;
  const std::size_t count = std::min(pairs.pairs.bytes() / sizeof(pair_layout::SurfacePair), most),
                    bytes = count * sizeof(ContactArrow);
  if (renderer.contact_arrows.bytes() != bytes) renderer.contact_arrows = Buffer("arrows of contacts", bytes);
  if (renderer.contact_sizes != pairs.defines) {
    renderer.passes["touches"] = {Program::compute("render/touches.comp", {}, pairs.defines)};
    renderer.contact_sizes = pairs.defines;
  }
  Recorder& recorder = renderer.recorder;
  recorder.give("Positions", frame.positions), recorder.give("Arrows", renderer.contact_arrows);
  recorder.give("PairLists", pairs.lists), recorder.give("Pairs", pairs.pairs);
  run_over(renderer, kernel(renderer, "touches"), count);
  recorder.barrier(GL_VERTEX_ATTRIB_ARRAY_BARRIER_BIT);
  const GLuint arrows = renderer.contact_arrows.id();
  attribute(ATTRIBUTE_HIGH, arrows, 3, sizeof(ContactArrow), offsetof(ContactArrow, from));
  attribute(ATTRIBUTE_VALUE, arrows, 1, sizeof(ContactArrow), offsetof(ContactArrow, depth));
  attribute(ATTRIBUTE_VELOCITY, arrows, 3, sizeof(ContactArrow), offsetof(ContactArrow, along));
  for (const GLuint none : {ATTRIBUTE_LOW, ATTRIBUTE_REST}) attribute(none, 0, 1, 0, 0);
  const Program& program = use(renderer, "contact arrows");
  program.set("seconds", 0.04f * size);
  program.set("deepest", 0.05f);
  program.set("viewport", glm::vec3(frame.viewport.width, frame.viewport.height, 0));
  program.set("width", scaled(frame, 1.8f));
  glDisable(GL_DEPTH_TEST);
  glDrawArrays(GL_POINTS, 0, GLsizei(count));
  glEnable(GL_DEPTH_TEST);
  glDisableVertexAttribArray(ATTRIBUTE_VELOCITY);
  bind_vertices(renderer, frame);
}

void draw_arrows(Renderer& renderer, const Frame& frame) {
  constexpr std::size_t about = 300;  // arrows
  if (!renderer.arrow_vertices) {
    std::vector<std::uint32_t> vertices;
    for (const Triangle& triangle : renderer.mesh.surface)
      vertices.insert(vertices.end(), triangle.begin(), triangle.end());
    std::ranges::sort(vertices);
    const auto [again, end] = std::ranges::unique(vertices);
    vertices.erase(again, end);
    const std::size_t every = vertices.size() / about + 1;  // neighbours in number are neighbours in space
    std::vector<std::uint32_t> some;
    for (std::size_t i = 0; i < vertices.size(); i += every) some.push_back(vertices[i]);
    renderer.arrow_vertices = Buffer("arrow vertices", some);
  }
  attribute(ATTRIBUTE_VELOCITY, frame.velocities, 3, sizeof(Velocity), offsetof(Velocity, high));
  const Program& program = use(renderer, "arrows");
  program.set("seconds", float(frame.options.arrow_seconds));
  program.set("viewport", glm::vec3(frame.viewport.width, frame.viewport.height, 0));
  program.set("width", scaled(frame, 1.4f));
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, renderer.arrow_vertices.id());
  glDrawElements(GL_POINTS, GLsizei(renderer.arrow_vertices.bytes() / 4), GL_UNSIGNED_INT, nullptr);
  glDisableVertexAttribArray(ATTRIBUTE_VELOCITY);
}

void draw_dots(Renderer& renderer, const Frame& frame) {
  const Program& program = use(renderer, "dots");
  const auto batch = [&](const std::vector<std::uint32_t>& vertices, const glm::vec3& colour, float size,
                         float hole = 0) {
    program.set("colour", colour);
    program.set("hole", hole);
    program.set("size", scaled(frame, size));
    const std::vector<GLint> first(vertices.begin(), vertices.end());
    const std::vector<GLsizei> ones(vertices.size(), 1);
    glMultiDrawArrays(GL_POINTS, first.data(), ones.data(), GLsizei(first.size()));
  };
  batch(frame.grabbed, glm::vec3(0.90f, 0.32f, 0.02f), 12.0f);  // first, so that it covers the vertex's own pin
  batch(frame.pinned, glm::vec3(0.020f, 0.035f, 0.060f), 7.0f);
  glDisable(GL_DEPTH_TEST);
  if (frame.options.contacts) batch(frame.touching, contact_colour, 7.0f);
  batch(frame.worst, worst_colour, 18.0f, 0.68f);
  if (frame.tet) {
    const Tet& tet = renderer.mesh.tets[*frame.tet];
    batch({tet.begin(), tet.end()}, worst_colour, 8.0f);
  }
}

// With a pale rim, which shows them on any colour; corners have dots, because a sliver may be smaller than a pixel.
void draw_tet(Renderer& renderer, const Frame& frame) {
  const Tet& tet = renderer.mesh.tets.at(*frame.tet);
  if (std::exchange(renderer.edged_tet, frame.tet) != frame.tet) {
    std::vector<std::array<std::uint32_t, 2>> edges;
    for (std::size_t a = 0; a < 4; ++a)
      for (std::size_t b = 0; b < a; ++b) edges.push_back({tet[a], tet[b]});
    renderer.tet_edges = Buffer("edges of a tet", edges);
  }
  const Program& program = use(renderer, "edges of a tet");
  program.set("viewport", glm::vec3(frame.viewport.width, frame.viewport.height, 0));
  glDisable(GL_DEPTH_TEST);
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, renderer.tet_edges.id());
  for (const auto& [shade, width] : {std::pair(glm::vec3(1), 4.5f), {worst_colour, 2.2f}}) {
    program.set("shade", shade);
    program.set("width", scaled(frame, width));
    glDrawElements(GL_LINES, 12, GL_UNSIGNED_INT, nullptr);
  }
  glEnable(GL_DEPTH_TEST);
}

}  // namespace

void draw_marks(Renderer& renderer, const Frame& frame) {
  if (!frame.options.contacts && !frame.options.arrows && frame.pinned.empty() && frame.grabbed.empty() &&
      frame.worst.empty() && !frame.tet)
    return;
  bind_vertices(renderer, frame);
  glEnable(GL_PROGRAM_POINT_SIZE);
  if (frame.options.contacts) draw_contacts(renderer, frame);
  if (frame.options.contacts && frame.pairs) draw_body_contacts(renderer, frame);
  if (frame.options.arrows) draw_arrows(renderer, frame);
  if (frame.tet) draw_tet(renderer, frame);
  draw_dots(renderer, frame);
  glDisable(GL_PROGRAM_POINT_SIZE);
}

}  // namespace tetpbd
