// A soft block falls onto the ground, simulated in an OpenGL context that this program makes itself.
#include <EGL/egl.h>
#include <EGL/eglext.h>

#include <cstdio>

#include "sim/sim.h"

int main() try {
  EGLDisplay display = eglGetDisplay(EGL_DEFAULT_DISPLAY);
  if (!eglInitialize(display, nullptr, nullptr)) {  // Mesa without a desktop
    display = eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
    eglInitialize(display, nullptr, nullptr);
  }
  eglBindAPI(EGL_OPENGL_API);
  const EGLint wanted[] = {EGL_CONTEXT_MAJOR_VERSION, 4, EGL_CONTEXT_MINOR_VERSION, 3, EGL_NONE};
  const EGLContext context = eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, wanted);
  eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context);

  tetpbd::TetMesh mesh = tetpbd::make_block({0.4, 0.2, 0.4}, {4, 2, 4});  // m, cells
  for (glm::dvec3& x : mesh.positions) x.y += 0.3;
  const auto model = std::make_shared<tetpbd::Model>();
  tetpbd::add_body(*model, "block", mesh, 1000, mesh.positions, glm::dvec3(0), glm::dvec3(0), {});
  tetpbd::Settings settings;
  settings.material = "neo-hookean", settings.young_modulus = 1e5;  // Pa
  tetpbd::Sim sim = tetpbd::create_sim(model, settings);
  for (int s = 0; s < 100; ++s) tetpbd::step(sim);
  const glm::dvec3 x = tetpbd::read_state(sim).positions.back();
  std::printf("%.6f %.6f %.6f\n", x.x, x.y, x.z);
} catch (const tetpbd::Error& error) {
  std::fprintf(stderr, "embed: %s\n", error.what());
  return error.exit_status;
}
