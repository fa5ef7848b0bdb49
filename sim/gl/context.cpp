#include "sim/gl/context.h"

#include <GL/glew.h>
#define EGL_NO_X11
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <fmt/format.h>

#include <atomic>

#include "sim/error.h"

namespace tetpbd {

namespace {

std::atomic<int> error_count = 0;

void GLAPIENTRY on_message(GLenum source, GLenum type, GLuint, GLenum, GLsizei, const GLchar* text,
                           const void* report) {
  // What the shader compiler finds is thrown as an Error with file and line.
  if (type != GL_DEBUG_TYPE_ERROR || source == GL_DEBUG_SOURCE_SHADER_COMPILER) return;
  ++error_count;
  if (report) reinterpret_cast<GlErrorReport>(report)(text);
}

std::string or_empty(const char* text) { return text ? text : ""; }

std::string gl_string(GLenum name) { return or_empty(reinterpret_cast<const char*>(glGetString(name))); }

int gl_integer(GLenum name) {
  GLint value = 0;
  glGetIntegerv(name, &value);
  return value;
}

std::vector<EGLDeviceEXT> query_devices() {
  const auto query = reinterpret_cast<PFNEGLQUERYDEVICESEXTPROC>(eglGetProcAddress("eglQueryDevicesEXT"));
  EGLint count = 0;
  if (!query || !query(0, nullptr, &count)) return {};
  std::vector<EGLDeviceEXT> devices(static_cast<std::size_t>(count));
  query(count, devices.data(), &count);
  return devices;
}

std::string device_string(EGLDeviceEXT device, EGLint name) {
  const auto query = reinterpret_cast<PFNEGLQUERYDEVICESTRINGEXTPROC>(eglGetProcAddress("eglQueryDeviceStringEXT"));
  return or_empty(query ? query(device, name) : nullptr);
}

bool is_software(EGLDeviceEXT device) {
  return device_string(device, EGL_EXTENSIONS).find("MESA_device_software") != std::string::npos;
}

// Makes a context current; none where that fails. `any_version`: whatever the driver has, so that load_gl() can say it.
// With `reset`, the driver reports a GPU reset, and it still checks no bounds in shaders.
EGLContext make_context(EGLDisplay display, bool debug, bool any_version, bool reset) {
  if (display == EGL_NO_DISPLAY || !eglInitialize(display, nullptr, nullptr)) return EGL_NO_CONTEXT;
  if (!eglBindAPI(EGL_OPENGL_API)) return EGL_NO_CONTEXT;
  const EGLint attributes[][2] = {
      {EGL_CONTEXT_MAJOR_VERSION, 4},
      {EGL_CONTEXT_MINOR_VERSION, 3},
      {EGL_CONTEXT_OPENGL_PROFILE_MASK, EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT},
      {EGL_CONTEXT_OPENGL_DEBUG, debug},
      {reset ? EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY : EGL_NONE, EGL_LOSE_CONTEXT_ON_RESET},
      {EGL_NONE, EGL_NONE}};
  const EGLContext context =
      eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, attributes[any_version ? 3 : 0]);
  if (context == EGL_NO_CONTEXT || eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context)) return context;
  eglDestroyContext(display, context);
  return EGL_NO_CONTEXT;
}

}  // namespace

int gl_error_count() { return error_count; }

Capabilities capabilities() {
  Capabilities caps{.vendor = gl_string(GL_VENDOR),
                    .renderer = gl_string(GL_RENDERER),
                    .version = gl_string(GL_VERSION),
                    .shading_language = gl_string(GL_SHADING_LANGUAGE_VERSION),
                    .storage_blocks = gl_integer(GL_MAX_COMPUTE_SHADER_STORAGE_BLOCKS),
                    .work_group_invocations = gl_integer(GL_MAX_COMPUTE_WORK_GROUP_INVOCATIONS),
                    .shared_bytes = gl_integer(GL_MAX_COMPUTE_SHARED_MEMORY_SIZE),
                    .samples = gl_integer(GL_MAX_SAMPLES)};
  glGetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &caps.storage_bytes);
  for (const char* name : {"llvmpipe", "softpipe", "swrast", "SWR"})
    caps.software = caps.software || caps.renderer.find(name) != std::string::npos;
  return caps;
}

std::size_t most_work_groups_in_row() {
  GLint most = 0;
  glGetIntegeri_v(GL_MAX_COMPUTE_WORK_GROUP_COUNT, 0, &most);
  return std::size_t(most);
}

Capabilities load_gl() {
  glewExperimental = GL_TRUE;
  // GLEW built for GLX returns GLEW_ERROR_NO_GLX_DISPLAY (4) under EGL, with every function loaded.
  const GLenum result = glewInit();
  if (result != GLEW_OK && result != GLEW_ERROR_NO_GLX_DISPLAY)
    throw Error("OpenGL functions did not load", reinterpret_cast<const char*>(glewGetErrorString(result)),
                "check the OpenGL driver", 1);
  if (gl_integer(GL_MAJOR_VERSION) * 10 + gl_integer(GL_MINOR_VERSION) < 43)
    throw Error("OpenGL 4.3 is needed", "the driver offers " + gl_string(GL_VERSION),
                "use a newer driver or another GPU (tetpbd info lists them)", 1);
  return capabilities();
}

void count_gl_errors(GlErrorReport report) {
  if (!(gl_integer(GL_CONTEXT_FLAGS) & GL_CONTEXT_FLAG_DEBUG_BIT)) return;
  glEnable(GL_DEBUG_OUTPUT);
  glEnable(GL_DEBUG_OUTPUT_SYNCHRONOUS);
  glDebugMessageCallback(on_message, reinterpret_cast<const void*>(report));
}

void check_context() {
  if (!GLEW_KHR_robustness && !GLEW_VERSION_4_5) return;
  const GLenum status = glGetGraphicsResetStatus();
  if (status == GL_NO_ERROR) return;
  const bool guilty = status == GL_GUILTY_CONTEXT_RESET;
  throw ContextLost("the GPU was reset",
                    guilty ? "by what this program did (a step too long for it?)" : "by another program",
                    "start again; if it happens again, use fewer iterations, substeps or a smaller mesh, and "
                    "look into the system's log",
                    1);
}

std::vector<std::string> list_devices() {
  std::vector<std::string> names;
  for (EGLDeviceEXT device : query_devices())
    names.push_back(is_software(device) ? "software renderer (Mesa)"
                                        : "GPU " + device_string(device, EGL_DRM_DEVICE_FILE_EXT));
  return names;
}

HeadlessContext::HeadlessContext(int device, bool debug) {
  const std::vector<EGLDeviceEXT> devices = query_devices();
  if (device >= int(devices.size()))
    throw Error("no such GPU", fmt::format("--gpu {}", device), "tetpbd info lists them");
  std::vector<EGLDisplay> displays;
  for (EGLDeviceEXT one : devices)
    if (device < 0 ? !is_software(one) : one == devices[std::size_t(device)])
      displays.push_back(eglGetPlatformDisplay(EGL_PLATFORM_DEVICE_EXT, one, nullptr));
  if (device < 0)
    displays.push_back(eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr));
  for (const bool any_version : {false, true})
    for (std::size_t i = 0; i < 2 * displays.size(); ++i) {
      display_ = displays[i / 2];
      context_ = make_context(display_, debug, any_version, i % 2 == 0);
      if (context_ == EGL_NO_CONTEXT) continue;
      capabilities_ = load_gl();
      count_gl_errors();
      return;
    }
  throw Error("no OpenGL 4.3 context", device < 0 ? "any device of EGL" : fmt::format("--gpu {}", device),
              "install a newer driver, or libegl-mesa0 and libgl1-mesa-dri for software rendering", 1);
}

// The display stays initialised, because Mesa would unload its driver and leak checkers then report that driver.
HeadlessContext::~HeadlessContext() {
  if (!context_) return;
  eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  eglDestroyContext(display_, context_);
}

}  // namespace tetpbd
