#include "sim/gl/context.h"

#define EGL_NO_X11
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <fmt/format.h>

#include "sim/error.h"

namespace tetpbd {

namespace {

std::vector<EGLDeviceEXT> query_devices() {
  const auto query = reinterpret_cast<PFNEGLQUERYDEVICESEXTPROC>(eglGetProcAddress("eglQueryDevicesEXT"));
  EGLint count = 0;
  if (!query || !query(0, nullptr, &count)) return {};
  std::vector<EGLDeviceEXT> devices(static_cast<std::size_t>(count));
  query(count, devices.data(), &count);
  return devices;
}

const char* device_extensions(EGLDeviceEXT device) {
  const auto query =
      reinterpret_cast<PFNEGLQUERYDEVICESTRINGEXTPROC>(eglGetProcAddress("eglQueryDeviceStringEXT"));
  const char* text = query ? query(device, EGL_EXTENSIONS) : nullptr;
  return text ? text : "";
}

std::string device_name(EGLDeviceEXT device) {
  const std::string extensions = device_extensions(device);
  if (extensions.find("NV_device_cuda") != std::string::npos) return "NVIDIA GPU";
  if (extensions.find("MESA_device_software") != std::string::npos) return "software renderer (Mesa)";
  const auto query =
      reinterpret_cast<PFNEGLQUERYDEVICESTRINGEXTPROC>(eglGetProcAddress("eglQueryDeviceStringEXT"));
  const char* file = query ? query(device, EGL_DRM_DEVICE_FILE_EXT) : nullptr;
  return file ? fmt::format("GPU {}", file) : "GPU";
}

EGLDisplay platform_display(EGLenum platform, void* native) {
  const auto get =
      reinterpret_cast<PFNEGLGETPLATFORMDISPLAYEXTPROC>(eglGetProcAddress("eglGetPlatformDisplayEXT"));
  if (!get) return EGL_NO_DISPLAY;
  return get(platform, native, nullptr);
}

/// `version`: major and minor; 0: whatever the driver makes. With `reset`, the driver tells of a GPU that was
/// reset (and of nothing else: bounds checks in shaders would cost time).
EGLContext make_context(EGLDisplay display, bool debug, int version = 43, bool reset = true) {
  if (display == EGL_NO_DISPLAY || !eglInitialize(display, nullptr, nullptr)) return EGL_NO_CONTEXT;
  if (!eglBindAPI(EGL_OPENGL_API)) return EGL_NO_CONTEXT;
  const EGLint config_attributes[] = {EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_NONE};
  EGLConfig config = nullptr;
  EGLint count = 0;
  if (!eglChooseConfig(display, config_attributes, &config, 1, &count) || count == 0) config = nullptr;
  if (version == 0) return eglCreateContext(display, config, EGL_NO_CONTEXT, nullptr);
  std::vector<EGLint> attributes = {EGL_CONTEXT_MAJOR_VERSION,       version / 10,
                                    EGL_CONTEXT_MINOR_VERSION,       version % 10,
                                    EGL_CONTEXT_OPENGL_PROFILE_MASK, EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                    EGL_CONTEXT_OPENGL_DEBUG,        debug ? EGL_TRUE : EGL_FALSE};
  if (reset)
    attributes.insert(attributes.end(),
                      {EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY, EGL_LOSE_CONTEXT_ON_RESET});
  attributes.push_back(EGL_NONE);
  const EGLContext context = eglCreateContext(display, config, EGL_NO_CONTEXT, attributes.data());
  return context == EGL_NO_CONTEXT && reset ? make_context(display, debug, version, false) : context;
}

/// Of the first display that makes any context.
std::string offered_version(const std::vector<EGLDisplay>& displays) {
  for (EGLDisplay display : displays) {
    const EGLContext context = make_context(display, false, 0);
    if (context == EGL_NO_CONTEXT) continue;
    std::string text;
    if (eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context))
      if (const GLubyte* version = glGetString(GL_VERSION)) text = reinterpret_cast<const char*>(version);
    eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    eglDestroyContext(display, context);
    if (!text.empty()) return text;
  }
  return {};
}

}  // namespace

std::vector<std::string> list_devices() {
  std::vector<std::string> names;
  for (EGLDeviceEXT device : query_devices()) names.push_back(device_name(device));
  return names;
}

HeadlessContext::HeadlessContext(int device, bool debug) {
  const std::vector<EGLDeviceEXT> devices = query_devices();
  if (device >= int(devices.size()))
    throw Error("no such GPU", fmt::format("--gpu {}", device),
                fmt::format("this machine has {}: see tetpbd info", devices.size()));
  std::vector<EGLDisplay> displays;
  if (device >= 0) {
    displays.push_back(platform_display(EGL_PLATFORM_DEVICE_EXT, devices[std::size_t(device)]));
  } else {
    for (EGLDeviceEXT candidate : devices)  // hardware first: a software device names itself
      if (std::string(device_extensions(candidate)).find("MESA_device_software") == std::string::npos)
        displays.push_back(platform_display(EGL_PLATFORM_DEVICE_EXT, candidate));
    displays.push_back(platform_display(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY));
    for (EGLDeviceEXT candidate : devices)
      displays.push_back(platform_display(EGL_PLATFORM_DEVICE_EXT, candidate));
  }
  for (EGLDisplay display : displays) {
    const EGLContext context = make_context(display, debug);
    if (context == EGL_NO_CONTEXT) continue;
    if (!eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context)) {
      eglDestroyContext(display, context);
      continue;
    }
    display_ = display;
    context_ = context;
    capabilities_ = load_gl();
    return;
  }
  const std::string which = device >= 0 ? fmt::format("--gpu {}", device) : "EGL, any device";
  if (const std::string version = offered_version(displays); !version.empty())
    throw Error("OpenGL 4.3 is needed", fmt::format("{}: the driver offers {}", which, version),
                "use a newer driver or another GPU (tetpbd info lists them)", 1);
  throw Error("no OpenGL 4.3 context", devices.empty() ? "EGL finds no device and no driver" : which,
              "install a driver, or libegl-mesa0 and libgl1-mesa-dri for software rendering", 1);
}

HeadlessContext::~HeadlessContext() {
  if (!context_) return;
  eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  eglDestroyContext(display_, context_);
  // The display stays initialised: Mesa unloads its driver with it, and leak checkers then report that
  // driver.
}

}  // namespace tetpbd
