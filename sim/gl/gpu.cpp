#include "sim/gl/gpu.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <regex>
#include <sstream>

#include "sim/error.h"
#include "sim/gl/program_cache.h"

namespace tetpbd {

const std::vector<std::pair<std::string, std::string>>& embedded_shaders();

namespace {

std::atomic<int> error_count = 0;
std::atomic<long> live_objects = 0;
std::atomic<std::int64_t> live_buffer_bytes = 0;

void GLAPIENTRY on_message(GLenum source, GLenum type, GLuint, GLenum, GLsizei, const GLchar* text,
                           const void*) {
  // What the shader compiler finds is thrown as an Error with file and line.
  if (type != GL_DEBUG_TYPE_ERROR || source == GL_DEBUG_SOURCE_SHADER_COMPILER) return;
  ++error_count;
  std::fprintf(stderr, "GL error: %s\n", text);
}

std::string gl_string(GLenum name) {
  const auto* text = reinterpret_cast<const char*>(glGetString(name));
  return text ? text : "";
}

int gl_integer(GLenum name) {
  GLint value = 0;
  glGetIntegerv(name, &value);
  return value;
}

void label_object(GLenum kind, GLuint id, const std::string& label) {
  glObjectLabel(kind, id, GLsizei(label.size()), label.data());
}

}  // namespace

int gl_error_count() { return error_count; }

GlLive gl_live() { return {live_objects, live_buffer_bytes}; }

void count_gl_objects(long change, std::int64_t buffer_bytes) {
  live_objects += change;
  live_buffer_bytes += buffer_bytes;
}

bool is_software_renderer() {
  const std::string renderer = gl_string(GL_RENDERER);
  for (const char* name : {"llvmpipe", "softpipe", "swrast", "SWR"})
    if (renderer.find(name) != std::string::npos) return true;
  return false;
}

Limits gl_limits() {
  Limits limits;
  limits.storage_blocks = gl_integer(GL_MAX_COMPUTE_SHADER_STORAGE_BLOCKS);
  glGetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &limits.storage_bytes);
  GLint groups = 0;
  glGetIntegeri_v(GL_MAX_COMPUTE_WORK_GROUP_COUNT, 0, &groups);
  limits.work_groups = unsigned(groups);
  return limits;
}

void check_work_groups(const std::string& kernel, std::size_t groups, const Limits& limits) {
  if (groups > limits.work_groups)
    throw Error("too many work-groups",
                fmt::format("{} needs {}, the driver allows {}", kernel, groups, limits.work_groups),
                "use a smaller mesh or another GPU (tetpbd info lists them)", 1);
}

namespace {
GLenum (*given_reset_status)() = nullptr;
}

void set_reset_status(GLenum (*answer)()) { given_reset_status = answer; }

void check_context() {
  GLenum status = GL_NO_ERROR;
  if (given_reset_status)
    status = given_reset_status();
  else if (GLEW_KHR_robustness || GLEW_VERSION_4_5)
    status = glGetGraphicsResetStatus();
  else if (GLEW_ARB_robustness)
    status = glGetGraphicsResetStatusARB();
  if (status == GL_NO_ERROR) return;
  const char* whose = status == GL_GUILTY_CONTEXT_RESET ? "by what this program did (a step too long for it?)"
                      : status == GL_INNOCENT_CONTEXT_RESET ? "by another program"
                                                            : "for an unknown reason";
  throw ContextLost(
      "the GPU was reset", whose,
      "start again; if it happens again, use fewer iterations, substeps or a smaller mesh, and look "
      "into the system's log",
      1);
}

bool reached(GLsync fence, bool wait, const char* what) {
  constexpr GLuint64 slice =
      1'000'000'000u;  // ns; a step may take as long as it likes, a lost GPU is noticed
  for (;;) {
    const GLenum state = glClientWaitSync(fence, GL_SYNC_FLUSH_COMMANDS_BIT, wait ? slice : 0u);
    if (state == GL_ALREADY_SIGNALED || state == GL_CONDITION_SATISFIED) return true;
    if (state == GL_TIMEOUT_EXPIRED && !wait) return false;
    check_context();
    if (state == GL_WAIT_FAILED) break;
  }
  throw Error("the GPU does not answer", what, "use fewer iterations or substeps, or a smaller mesh", 1);
}

void clear_errors() {
  // A lost context answers an error for ever.
  for (int i = 0; i < 100 && glGetError() != GL_NO_ERROR; ++i) {
  }
}

namespace {
Error out_of_memory(const std::string& what, std::size_t bytes) {
  return Error("out of GPU memory", fmt::format("{} of {} bytes", what, bytes),
               "use a smaller mesh, a smaller image or fewer samples", 1);
}
}  // namespace

void check_memory(const std::string& what, std::size_t bytes) {
  if (glGetError() != GL_NO_ERROR)  // drivers call an absurd size by other names than GL_OUT_OF_MEMORY
    throw out_of_memory(what, bytes);
}

Capabilities load_gl() {
  glewExperimental = GL_TRUE;
  // GLEW built for GLX answers GLEW_ERROR_NO_GLX_DISPLAY (4) under EGL, with every function loaded.
  const GLenum result = glewInit();
  if (result != GLEW_OK && result != GLEW_ERROR_NO_GLX_DISPLAY)
    throw Error("OpenGL functions did not load", reinterpret_cast<const char*>(glewGetErrorString(result)),
                "check the OpenGL driver", 1);
  Capabilities caps;
  caps.vendor = gl_string(GL_VENDOR);
  caps.renderer = gl_string(GL_RENDERER);
  caps.version = gl_string(GL_VERSION);
  caps.shading_language = gl_string(GL_SHADING_LANGUAGE_VERSION);
  if (gl_integer(GL_MAJOR_VERSION) * 10 + gl_integer(GL_MINOR_VERSION) < 43)
    throw Error("OpenGL 4.3 is needed", "the driver offers " + caps.version, "use a newer driver or GPU", 1);
  caps.storage_blocks = gl_integer(GL_MAX_COMPUTE_SHADER_STORAGE_BLOCKS);
  glGetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &caps.storage_bytes);
  caps.work_group_invocations = gl_integer(GL_MAX_COMPUTE_WORK_GROUP_INVOCATIONS);
  caps.shared_bytes = gl_integer(GL_MAX_COMPUTE_SHARED_MEMORY_SIZE);
  caps.samples = gl_integer(GL_MAX_SAMPLES);
  caps.software = is_software_renderer();
  caps.reset_status = GLEW_KHR_robustness || GLEW_VERSION_4_5 || GLEW_ARB_robustness;
  caps.debug = gl_integer(GL_CONTEXT_FLAGS) & GL_CONTEXT_FLAG_DEBUG_BIT;
  if (caps.debug) {
    glEnable(GL_DEBUG_OUTPUT);
    glEnable(GL_DEBUG_OUTPUT_SYNCHRONOUS);
    glDebugMessageCallback(on_message, nullptr);
  }
  return caps;
}

// ----------------------------------------------------------------------------------------------------------
// buffers

Buffer::Buffer(std::string label, std::size_t bytes, const void* data, GLenum usage)
    : bytes_(bytes), label_(std::move(label)), whole_at_once_(usage == GL_STREAM_DRAW) {
  clear_errors();
  glGenBuffers(1, &id_);
  glBindBuffer(GL_COPY_WRITE_BUFFER, id_);
  glBufferData(GL_COPY_WRITE_BUFFER, GLsizeiptr(std::max<std::size_t>(bytes, 4)), data, usage);
  try {
    const std::string what = fmt::format("buffer '{}'", label_);
    check_memory(what, bytes);
    GLint64 made = 0;  // some drivers say nothing
    glGetBufferParameteri64v(GL_COPY_WRITE_BUFFER, GL_BUFFER_SIZE, &made);
    if (std::size_t(made) < bytes) throw out_of_memory(what, bytes);
  } catch (...) {
    glDeleteBuffers(1, &id_);
    throw;
  }
  label_object(GL_BUFFER, id_, label_);
  count_gl_objects(1, std::int64_t(bytes_));
}

Buffer::~Buffer() {
  if (!id_) return;
  glDeleteBuffers(1, &id_);
  count_gl_objects(-1, -std::int64_t(bytes_));
}

// Kernels queued before may still read or write the buffer (docs/barriers.md).
void Buffer::write(std::size_t offset, std::size_t bytes, const void* data) const {
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  if (whole_at_once_ && offset == 0 && bytes == bytes_) {
    glBindBuffer(GL_COPY_WRITE_BUFFER, id_);
    glBufferData(GL_COPY_WRITE_BUFFER, GLsizeiptr(bytes), data, GL_STREAM_DRAW);
    return;
  }
  // Through a buffer of its own: NVIDIA's 580 driver lets a kernel that follows glBufferSubData see the old
  // bytes, whatever barriers stand between, unless something flushes (docs/decisions.md).
  GLuint staging = 0;
  glGenBuffers(1, &staging);
  glBindBuffer(GL_COPY_READ_BUFFER, staging);
  glBufferData(GL_COPY_READ_BUFFER, GLsizeiptr(bytes), data, GL_STREAM_DRAW);
  glBindBuffer(GL_COPY_WRITE_BUFFER, id_);
  glCopyBufferSubData(GL_COPY_READ_BUFFER, GL_COPY_WRITE_BUFFER, 0, GLintptr(offset), GLsizeiptr(bytes));
  glDeleteBuffers(1, &staging);
}

void Buffer::read(std::size_t offset, std::size_t bytes, void* data) const {
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  glBindBuffer(GL_COPY_READ_BUFFER, id_);
  glGetBufferSubData(GL_COPY_READ_BUFFER, GLintptr(offset), GLsizeiptr(bytes), data);
}

void Buffer::clear() const {
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  glBindBuffer(GL_COPY_WRITE_BUFFER, id_);
  glClearBufferData(GL_COPY_WRITE_BUFFER, GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT, nullptr);
}

// ----------------------------------------------------------------------------------------------------------
// shaders

namespace {

std::string& folder_setting() {
  static std::string folder = [] {
    const char* variable = std::getenv("TETPBD_SHADERS");
    return std::string(variable ? variable : "");
  }();
  return folder;
}

std::string read_shader_file(const std::string& name) {
  if (const std::string& folder = shader_folder(); !folder.empty()) {
    std::ifstream file(std::filesystem::path(folder) / name, std::ios::binary);
    if (!file)
      throw Error("no such shader", folder + "/" + name,
                  "point --shaders or TETPBD_SHADERS at a copy of shaders/");
    return {std::istreambuf_iterator<char>(file), {}};
  }
  for (const auto& [key, text] : embedded_shaders())
    if (key == name) return text;
  throw Error("no such shader", name, "it is not one of the files of shaders/", 1);
}

bool is_name(char c) { return (c >= 'A' && c <= 'Z') || c == '_' || (c >= '0' && c <= '9'); }

std::string substitute(const std::string& text, const Substitutions& words) {
  std::string result;
  for (std::size_t i = 0; i < text.size();) {
    std::size_t end = i + 1;
    if (text[i] == '$')
      while (end < text.size() && is_name(text[end])) ++end;
    const auto found = text[i] == '$' ? words.find(text.substr(i + 1, end - i - 1)) : words.end();
    result += found == words.end() ? text.substr(i, end - i) : found->second;
    i = end;
  }
  return result;
}

}  // namespace

void set_shader_folder(const std::string& folder) {
  if (!folder.empty() && !std::filesystem::is_directory(folder))
    throw Error("no such shader folder", folder, "point --shaders at a copy of shaders/");
  folder_setting() = folder;
}

const std::string& shader_folder() { return folder_setting(); }

std::int64_t shader_folder_version() {
  if (shader_folder().empty()) return 0;
  std::int64_t newest = std::numeric_limits<std::int64_t>::min();  // the file clock starts in 2174
  std::error_code ignored;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(shader_folder(), ignored))
    if (entry.is_regular_file(ignored))
      newest = std::max(newest, std::int64_t(entry.last_write_time(ignored).time_since_epoch().count()));
  return newest;
}

namespace {

// `files` collects the names in order; #line N I refers to files[I] (GLSL has numbers where C has names).
std::string expand(const std::string& name, const ShaderWords& words, std::vector<std::string>& files) {
  if (files.size() > 100) throw Error("shader includes do not end", name, "remove the circular #include", 1);
  const std::size_t index = files.size();
  files.push_back(name);
  std::istringstream lines(read_shader_file(name));
  std::string line, result = fmt::format("#line 1 {}\n", index);
  const auto expand_line = [&](const std::string& text, const ShaderWords& local, int number) {
    static const std::regex include(R"re(^\s*#include\s+"([^"]+)"\s*$)re");
    std::smatch match;
    const std::string filled = substitute(text, local.words);
    if (filled.find("#include") == std::string::npos || !std::regex_match(filled, match, include))
      result += filled + "\n";
    else
      result += expand(match[1], local, files) + fmt::format("#line {} {}\n", number + 1, index);
  };
  for (int number = 1; std::getline(lines, line); ++number) {
    constexpr std::string_view foreach = "#foreach ";
    const std::size_t start = line.find_first_not_of(' ');
    if (start == std::string::npos || line.compare(start, foreach.size(), foreach) != 0) {
      expand_line(line, words, number);
      continue;
    }
    for (const Substitutions& item : words.each) {
      ShaderWords local = words;
      for (const auto& [key, value] : item) local.words[key] = value;
      expand_line(line.substr(start + foreach.size()), local, number);
    }
    result += fmt::format("#line {} {}\n", number + 1, index);
  }
  return result;
}

// "0:12(3): error" (Mesa) and "2(17) : error" (NVIDIA) start with an index into `files`: put the name there.
std::string name_files(const std::string& log, const std::vector<std::string>& files) {
  std::istringstream lines(log);
  std::string line, result;
  static const std::regex position(R"(^(\d+)[:(](\d+)[^:]*:?\s*(.*)$)");
  while (std::getline(lines, line)) {
    std::smatch match;
    if (std::regex_match(line, match, position) && std::stoul(match[1]) < files.size())
      line = fmt::format("shaders/{}:{}: {}", files[std::stoul(match[1])], match[2].str(), match[3].str());
    if (!line.empty()) result += (result.empty() ? "" : "; ") + line;
    if (result.size() > 600) break;
  }
  return result;
}

GLuint compile_stage(GLenum type, const std::string& label, const std::string& text,
                     const std::vector<std::string>& files) {
  const GLuint shader = glCreateShader(type);
  const char* pointer = text.c_str();
  glShaderSource(shader, 1, &pointer, nullptr);
  glCompileShader(shader);
  GLint ok = 0;
  glGetShaderiv(shader, GL_COMPILE_STATUS, &ok);
  if (!ok) {
    std::string log(8192, '\0');
    GLsizei length = 0;
    glGetShaderInfoLog(shader, GLsizei(log.size()), &length, log.data());
    log.resize(std::size_t(length));
    glDeleteShader(shader);
    throw Error("shader does not compile", label, name_files(log, files), 1);
  }
  return shader;
}

GLuint link_program(const std::string& label, const std::vector<GLuint>& shaders) {
  const GLuint program = glCreateProgram();
  for (GLuint shader : shaders) glAttachShader(program, shader);
  glLinkProgram(program);
  for (GLuint shader : shaders) glDetachShader(program, shader), glDeleteShader(shader);
  GLint ok = 0;
  glGetProgramiv(program, GL_LINK_STATUS, &ok);
  if (!ok) {
    std::string log(8192, '\0');
    GLsizei length = 0;
    glGetProgramInfoLog(program, GLsizei(log.size()), &length, log.data());
    log.resize(std::size_t(length));
    glDeleteProgram(program);
    throw Error("shader program does not link", label, name_files(log, {}), 1);
  }
  return program;
}

constexpr const char* version_line = "#version 430 core\n";

// Where `set` looks for names: a uniform that nothing uses has no location and yet is no mistake.
std::string uniform_lines(const std::string& text) {
  std::istringstream lines(text);
  std::string line, result;
  while (std::getline(lines, line))
    if (line.find("uniform ") != std::string::npos) result += line + "\n";
  return result;
}

}  // namespace

std::string shader_text(const std::string& name, const ShaderWords& words) {
  std::vector<std::string> files;
  return expand(name, words, files);
}

Program::Program(std::string label, const std::vector<Stage>& stages, const ShaderWords& words,
                 const std::vector<std::string>& defines)
    : label_(std::move(label)) {
  std::string head = version_line;
  for (const std::string& define : defines) head += "#define " + define + "\n";
  std::vector<std::vector<std::string>> files(stages.size());
  std::vector<std::pair<GLenum, std::string>> texts;
  for (std::size_t s = 0; s < stages.size(); ++s) {
    texts.emplace_back(stages[s].type, head + expand(stages[s].file, words, files[s]));
    declarations_ += uniform_lines(texts.back().second);
  }
  const CacheKey key = program_key(texts, driver_lines());
  id_ = kept_program(key);
  if (!id_) {
    std::vector<GLuint> shaders;
    try {
      for (std::size_t s = 0; s < stages.size(); ++s)
        shaders.push_back(compile_stage(stages[s].type, stages[s].file, texts[s].second, files[s]));
    } catch (...) {
      for (GLuint shader : shaders) glDeleteShader(shader);
      throw;
    }
    id_ = link_program(label_, shaders);
    keep_program(key, id_);
  }
  label_object(GL_PROGRAM, id_, label_);
  count_gl_objects(1);
}

Program Program::compute(const std::string& file, const ShaderWords& words,
                         const std::vector<std::string>& defines) {
  std::string label = file.substr(0, file.rfind('.'));
  if (const auto kind = words.words.find("KIND"); kind != words.words.end()) label += " " + kind->second;
  for (const Substitutions& item : words.each)
    if (const auto kind = item.find("KIND"); kind != item.end()) label += " " + kind->second;
  return Program(label, {{GL_COMPUTE_SHADER, file}}, words, defines);
}

Program::~Program() {
  if (!id_) return;
  glDeleteProgram(id_);
  count_gl_objects(-1);
}

GLint Program::location(const char* name) const {
  const auto found = locations_.find(std::string_view(name));
  if (found != locations_.end()) return found->second;
  if (!std::regex_search(declarations_, std::regex(fmt::format("\\b{}\\b", name))))
    throw Error("no such uniform", fmt::format("'{}' in {}", name, label_),
                shader_folder().empty() ? "declare it in the shader" : "declare it in " + shader_folder(), 1);
  return locations_.emplace(name, glGetUniformLocation(id_, name)).first->second;
}

// -----------------------------------------------------------------------------------------------------------
// fences and timers

Fence Fence::here() {
  Fence fence;
  fence.sync_ = glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
  count_gl_objects(1);
  return fence;
}

Fence::~Fence() {
  if (!sync_) return;
  glDeleteSync(sync_);
  count_gl_objects(-1);
}

Timer::~Timer() {
  for (const Span& span : free_) glDeleteQueries(1, &span.begin), glDeleteQueries(1, &span.end);
  for (const Span& span : pending_) glDeleteQueries(1, &span.begin), glDeleteQueries(1, &span.end);
  count_gl_objects(-2 * long(free_.size() + pending_.size()));
}

void Timer::begin() {
  Span span;
  if (free_.empty()) {
    glGenQueries(1, &span.begin);
    glGenQueries(1, &span.end);
    count_gl_objects(2);
  } else {
    span = free_.back();
    free_.pop_back();
  }
  span.ended = false;
  glQueryCounter(span.begin, GL_TIMESTAMP);
  pending_.push_back(span);
}

void Timer::end() {
  glQueryCounter(pending_.back().end, GL_TIMESTAMP);
  pending_.back().ended = true;
}

std::optional<double> Timer::poll(bool wait) {
  if (pending_.empty() || !pending_.front().ended) return std::nullopt;
  const Span span = pending_.front();
  GLint available = 0;
  if (!wait) glGetQueryObjectiv(span.end, GL_QUERY_RESULT_AVAILABLE, &available);
  if (!wait && !available) return std::nullopt;
  GLuint64 begin = 0, end = 0;
  glGetQueryObjectui64v(span.begin, GL_QUERY_RESULT, &begin);
  glGetQueryObjectui64v(span.end, GL_QUERY_RESULT, &end);
  pending_.pop_front();
  free_.push_back(span);
  return double(end - begin) * 1e-6;
}

}  // namespace tetpbd
