// What the window does without a display: its panel's text, and a camera that follows.
#include <doctest/doctest.h>

#include "app/session.h"
#include "app/ui.h"
#include "render/target.h"
#include "tests/gl_test.h"

using namespace tetpbd;

TEST_CASE("window: every setting's label fits its column, whatever fonts the machine has") {
  ImGui::CreateContext();
  for (const float scale : {1.0f, 1.5f, 2.0f}) {
    set_style(scale, 1);
    unsigned char* pixels = nullptr;
    int width = 0, height = 0;
    ImGui::GetIO().Fonts->GetTexDataAsAlpha8(&pixels, &width, &height);
    CHECK(ImGui::GetIO().Fonts->Fonts[0]->FontSize == doctest::Approx(14 * scale));
    ImGui::GetIO().DisplaySize = {100, 100};
    ImGui::NewFrame();
    for (const Parameter& row : parameters()) {
      const std::string label = label_of(row.name.c_str());
      CAPTURE(label);
      CHECK(ImGui::CalcTextSize(label.c_str()).x < label_width());
    }
    ImGui::EndFrame();
  }
  ImGui::DestroyContext();
}

TEST_CASE("window: the camera follows bodies that go away, smoothly, and keeps where it was dragged") {
  GlTest gl;
  Scene scene;
  scene.bodies.emplace_back();
  scene.bodies[0].block.emplace();
  scene.settings.iterations = scene.settings.substeps = 1;
  Session s;
  s.view.follow = true;
  take_over(s, load("block", {}, scene), false);
  const Target target = make_target(64, 48);
  const glm::vec3 start{0, 0.5f, 0}, way{5, 0, -2};  // its middle, and how far it goes
  const auto frames = [&](int count) {
    bool moving = false;
    for (int i = 0; i < count; ++i) {
      draw(s.loaded.renderer, frame_of(s.loaded.sim, s.camera, s.view, target));
      glFinish();
      moving = follow_bodies(s, 0.05);
    }
    return moving;
  };
  CHECK_FALSE(frames(80));
  CHECK(glm::distance(s.camera.target, start) < 0.01f * s.camera.distance);
  State state = read_state(s.loaded.sim);
  for (glm::dvec3& p : state.positions) p += glm::dvec3(way);
  write_state(s.loaded.sim, state);
  CHECK(frames(2));
  CHECK(glm::distance(s.camera.target, start) < 0.5f * glm::length(way));  // no jump
  CHECK_FALSE(frames(80));
  CHECK(glm::distance(s.camera.target, start + way) < 0.01f * s.camera.distance);
  s.beside = {0, 1, 0};  // dragged
  frames(80);
  CHECK(glm::distance(s.camera.target, start + way + s.beside) < 0.01f * s.camera.distance);
  s.view.follow = false;
  reset(s.loaded.sim);
  frames(10);
  CHECK(glm::distance(s.camera.target, start + way + s.beside) < 0.01f * s.camera.distance);
  CHECK(gl_error_count() == 0);
}
