// A simulation in a GL context that others use as well.
#include <doctest/doctest.h>
#define EGL_NO_X11
#include <EGL/egl.h>
#include <EGL/eglext.h>

#include <cstring>
#include <functional>
#include <map>
#include <string>
#include <thread>

#include "sim/measure/metrics.h"
#include "sim/snapshot.h"
#include "tests/gl_test.h"
#include "tests/sim_samples.h"

using namespace tetpbd;

namespace {

// What a caller may have set, by what GL calls it.
std::map<std::string, GLint> caller_state() {
  std::map<std::string, GLint> state;
  const auto ask = [&](GLenum name, const std::string& label) { glGetIntegerv(name, &state[label]); };
#define ASK(name) ask(name, #name)
  ASK(GL_CURRENT_PROGRAM), ASK(GL_VERTEX_ARRAY_BINDING), ASK(GL_ARRAY_BUFFER_BINDING);
  ASK(GL_COPY_READ_BUFFER), ASK(GL_COPY_WRITE_BUFFER), ASK(GL_UNIFORM_BUFFER_BINDING);
  ASK(GL_SHADER_STORAGE_BUFFER_BINDING), ASK(GL_ATOMIC_COUNTER_BUFFER_BINDING);
  ASK(GL_DISPATCH_INDIRECT_BUFFER_BINDING), ASK(GL_DRAW_INDIRECT_BUFFER_BINDING);
  ASK(GL_PIXEL_PACK_BUFFER_BINDING), ASK(GL_PIXEL_UNPACK_BUFFER_BINDING);
  ASK(GL_PACK_ALIGNMENT), ASK(GL_UNPACK_ALIGNMENT), ASK(GL_UNPACK_ROW_LENGTH);
  ASK(GL_DRAW_FRAMEBUFFER_BINDING), ASK(GL_READ_FRAMEBUFFER_BINDING), ASK(GL_RENDERBUFFER_BINDING);
  ASK(GL_DEPTH_TEST), ASK(GL_BLEND), ASK(GL_CULL_FACE), ASK(GL_ACTIVE_TEXTURE);
#undef ASK
  const GLint unit = state["GL_ACTIVE_TEXTURE"];
  for (const GLint k : {0, 3, UNIT_FIELDS}) {
    glActiveTexture(GLenum(GL_TEXTURE0 + k));
    ask(GL_TEXTURE_BINDING_2D, "2D texture of unit " + std::to_string(k));
    ask(GL_TEXTURE_BINDING_BUFFER, "buffer texture of unit " + std::to_string(k));
    ask(GL_SAMPLER_BINDING, "sampler of unit " + std::to_string(k));
  }
  glActiveTexture(GLenum(unit));
  return state;
}

// Objects of a caller.
struct Caller {
  Program program = Program::compute("checkpoint.comp");
  Buffer buffer{"caller's", 64};
  VertexArray vertices{"caller's"};
  Framebuffer frame{"caller's"};
  Texture picture{"caller's"}, values{"caller's", GL_TEXTURE_BUFFER};
  void bind() const {
    glBindVertexArray(vertices.id()), glBindFramebuffer(GL_FRAMEBUFFER, frame.id());
    for (const GLint unit : {3, UNIT_FIELDS}) {
      glActiveTexture(GLenum(GL_TEXTURE0 + unit));
      glBindTexture(GL_TEXTURE_2D, picture.id()), glBindTexture(GL_TEXTURE_BUFFER, values.id());
    }
    glActiveTexture(GL_TEXTURE3);
    program.use();
    for (const GLenum target : {GL_ARRAY_BUFFER, GL_COPY_READ_BUFFER, GL_COPY_WRITE_BUFFER, GL_UNIFORM_BUFFER,
                                GL_SHADER_STORAGE_BUFFER, GL_ATOMIC_COUNTER_BUFFER, GL_DISPATCH_INDIRECT_BUFFER,
                                GL_DRAW_INDIRECT_BUFFER, GL_PIXEL_PACK_BUFFER, GL_PIXEL_UNPACK_BUFFER})
      glBindBuffer(target, buffer.id());
    glPixelStorei(GL_PACK_ALIGNMENT, 2), glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    glPixelStorei(GL_UNPACK_ROW_LENGTH, 7);
    glEnable(GL_DEPTH_TEST);
  }
};

// Two blocks, one above the other, over a height field: kernels of contact and obstacles run as well.
std::shared_ptr<const Model> scene() {
  auto model = std::make_shared<Model>();
  const TetMesh mesh = make_block({0.4, 0.2, 0.4}, {2, 1, 2});
  for (const double height : {0.2, 0.41}) {
    auto start = mesh.positions;
    for (auto& x : start) x.y += height;
    add_body(*model, "block", mesh, 1000, start, glm::dvec3(0), glm::dvec3(0), {});
  }
  Obstacle& hill = model->obstacles.emplace_back();
  hill.kind = find_obstacle_kind("height-field"), hill.half = {1, 0.1, 1};
  set_heights(hill, {{0.5, 0.6}, {0.4, 0.9}});
  return model;
}

}  // namespace

TEST_CASE_FIXTURE(GlTest, "a call leaves what its caller has bound as it was") {
  const Caller caller;
  std::map<std::string, GLint> before;
  const auto unchanged = [&](const std::string& mode, const std::string& call) {
    CAPTURE(mode);
    for (const auto& [name, value] : caller_state()) CHECK_MESSAGE(value == before.at(name), call << ": " << name);
  };
  const auto model = scene();
  Tuning tuning;
  tuning.count_guards = true;
  for (const std::string mode : {"node", "constraint", "paper", "explicit", "newton", "cpu-fast"}) {
    caller.bind();  // again, because destroying the simulation before may have unbound some
    before = caller_state();
    REQUIRE(before.at("GL_CURRENT_PROGRAM") == GLint(caller.program.id()));
    REQUIRE(before.at("GL_DISPATCH_INDIRECT_BUFFER_BINDING") == GLint(caller.buffer.id()));
    Settings settings;
    set_mode(settings, mode, "test");
    const SolverMode& row = solver_mode(settings);
    if (row.pairs) settings.contact = "bodies";
    if (row.forces) settings.material = "neo-hookean";
    Sim sim = create_sim(model, settings, tuning);
    unchanged(mode, "create_sim");
    for (int s = 0; s < 20; ++s) step(sim);
    unchanged(mode, "step");
    read_state(sim), state_hash(sim), guard_counts(sim), check_finite(sim, true);
    unchanged(mode, "reading");
    adaptive_values(sim), touched(sim), explain(sim);
    unchanged(mode, "what is known of steps");
    settings.dt *= 0.5;
    apply_settings(sim, settings);
    unchanged(mode, "apply_settings");
    settings.mode = mode == "node" ? "constraint" : "node";
    apply_settings(sim, settings);
    unchanged(mode, "apply_settings of another mode");
    rebuild_shaders(sim);
    unchanged(mode, "rebuild_shaders");
    pin(sim, 0), move_pinned(sim, 0, glm::dvec3(0)), unpin(sim, 0);
    unchanged(mode, "pin, move_pinned, unpin");
    change_obstacles(sim, model);
    unchanged(mode, "change_obstacles");
    Metrics metrics = create_metrics(*model);
    measure_now(metrics, sim);
    unchanged(mode, "measure, collect");
    const Buffer room("room", snapshot_bytes(sim));
    glBindBuffer(GL_COPY_WRITE_BUFFER, caller.buffer.id());  // a buffer's making itself keeps nothing
    restore_snapshot(sim, take_snapshot(sim, room, 0), room);
    unchanged(mode, "take_snapshot, restore_snapshot");
    write_state(sim, read_state(sim));
    reset(sim);
    unchanged(mode, "write_state, reset");
  }
}

namespace {

// Of a thread of its own, with the objects of the context that is current when it is made.
class SharedContext {
 public:
  SharedContext() {
    for (const EGLint reset : {EGL_LOSE_CONTEXT_ON_RESET, EGL_NO_RESET_NOTIFICATION}) {
      const EGLint attributes[] = {EGL_CONTEXT_MAJOR_VERSION,
                                   4,
                                   EGL_CONTEXT_MINOR_VERSION,
                                   3,
                                   EGL_CONTEXT_OPENGL_DEBUG,
                                   EGL_TRUE,
                                   EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY,
                                   reset,
                                   EGL_NONE};
      if (!context_) context_ = eglCreateContext(display_, EGL_NO_CONFIG_KHR, eglGetCurrentContext(), attributes);
    }
  }
  ~SharedContext() { eglDestroyContext(display_, context_); }
  SharedContext(const SharedContext&) = delete;
  SharedContext& operator=(const SharedContext&) = delete;
  explicit operator bool() const { return context_ != EGL_NO_CONTEXT; }
  void run(const std::function<void()>& work) const {
    eglBindAPI(EGL_OPENGL_API);
    REQUIRE(eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_));
    work();
    glFinish();
    eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  }

 private:
  EGLDisplay display_ = eglGetCurrentDisplay();
  EGLContext context_ = EGL_NO_CONTEXT;
};

}  // namespace

TEST_CASE_FIXTURE(GlTest, "a step in another context that shares objects gives the same bits") {
  const auto model = scene();
  for (const std::string mode : {"node", "explicit", "newton", "cpu-fast"}) {
    CAPTURE(mode);
    Settings settings;
    set_mode(settings, mode, "test");
    const SolverMode& row = solver_mode(settings);
    if (row.pairs) settings.contact = "bodies";
    if (row.forces) settings.material = "neo-hookean";
    Sim alone = create_sim(model, settings), handed = create_sim(model, settings);
    const Buffer shown("shown", handed.positions.bytes());
    const SharedContext other;  // goes before what it uses
    REQUIRE(other);
    for (int s = 0; s < 12; ++s) {
      step(alone);
      handed.positions.copy_to(shown, 0, 0, shown.bytes());
      const auto before = shown.read_all<float>();
      const Fence queued = Fence::here();
      glFlush();
      std::thread thread([&] {
        other.run([&] {
          glWaitSync(queued.sync(), 0, GL_TIMEOUT_IGNORED);
          step(handed);
        });
      });
      // Mesa's llvmpipe cannot take what two threads do at once.
      for (int k = 0; k < 20 && !is_software_renderer(); ++k) {
        const auto now = shown.read_all<float>();
        CHECK(std::memcmp(now.data(), before.data(), shown.bytes()) == 0);
      }
      thread.join();
    }
    CHECK(state_hash(handed) == state_hash(alone));
  }
}

TEST_CASE_FIXTURE(GlTest, "a caller's object that is gone is not bound again") {
  auto program = std::make_unique<Program>(Program::compute("checkpoint.comp"));
  program->use();
  program.reset();  // lives on as long as it is in use
  Sim sim = create_sim(samples::block_model({2, 1, 1}), samples::quick("node"));
  GLint now = -1;
  glGetIntegerv(GL_CURRENT_PROGRAM, &now);
  CHECK(now == 0);
  glBindBuffer(GL_COPY_READ_BUFFER, sim.positions.id());
  rebuild_shaders(sim);  // makes the buffer anew
  step(sim);
  CHECK(read_state(sim).positions.size() == 12);
}

TEST_CASE("without a context a simulation is refused") {
  { const GlTest loaded; }
  CHECK_THROWS_WITH_AS(create_sim(samples::block_model({1, 1, 1}), samples::quick("node")),
                       doctest::Contains("no OpenGL context is current"), Error);
}
