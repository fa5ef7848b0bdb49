#include <fmt/format.h>
#include <fmt/ranges.h>

#include <optional>
#include <regex>
#include <sstream>

#include "sim/error.h"
#include "sim/gl/gpu.h"

namespace tetpbd {

namespace {

void delete_shader(GLuint id) { glDeleteShader(id); }
using Shader = Owned<GLuint, delete_shader>;

// Makes a compiler's log one line, with file names in place of the numbers of #line.
std::string name_files(const std::string& log, const std::vector<std::string>& files) {
  std::istringstream lines(log);
  std::string line, result;
  // "0:12(3): error" (Mesa) and "2(17) : error" (NVIDIA)
  static const std::regex position(R"(^(\d+)[:(](\d+)[^:]*:?\s*(.*)$)");
  while (std::getline(lines, line) && result.size() <= 600) {
    std::smatch match;
    if (std::regex_match(line, match, position) && std::stoul(match[1]) < files.size())
      line = fmt::format("shaders/{}:{}: {}", files[std::stoul(match[1])], match[2].str(), match[3].str());
    if (!line.empty()) result += (result.empty() ? "" : "; ") + line;
  }
  return result;
}

// The compiler's or linker's log where it failed.
std::optional<std::string> failure_log(GLuint id, GLenum status) {
  const bool linked = status == GL_LINK_STATUS;
  GLint ok = 0;
  (linked ? glGetProgramiv : glGetShaderiv)(id, status, &ok);
  if (ok) return std::nullopt;
  std::string log(8192, '\0');
  GLsizei length = 0;
  (linked ? glGetProgramInfoLog : glGetShaderInfoLog)(id, GLsizei(log.size()), &length, log.data());
  return log.substr(0, std::size_t(length));
}

Shader compile(const std::string& stage, const std::string& text, const std::vector<std::string>& files) {
  Shader shader(glCreateShader(stage.ends_with(".vert")   ? GL_VERTEX_SHADER
                               : stage.ends_with(".geom") ? GL_GEOMETRY_SHADER
                               : stage.ends_with(".frag") ? GL_FRAGMENT_SHADER
                                                          : GL_COMPUTE_SHADER));
  const char* pointer = text.c_str();
  glShaderSource(shader.id(), 1, &pointer, nullptr);
  glCompileShader(shader.id());
  if (const auto log = failure_log(shader.id(), GL_COMPILE_STATUS))
    throw Error("shader does not compile", stage, name_files(*log, files), 1);
  return shader;
}

}  // namespace

Program::Program(std::string label, const std::vector<std::string>& stages, const ShaderWords& words,
                 const std::vector<std::string>& defines, std::size_t most_blocks)
    : Owned(glCreateProgram()), label_(std::move(label)) {
  std::string head = "#version 430 core\n";
  for (const std::string& define : defines) head += "#define " + define + "\n";
  std::vector<Shader> shaders;
  for (const std::string& stage : stages) {
    std::vector<std::string> files;
    const std::string text = head + shader_text(stage, words, files);
    text_ += text;
    dump_shader(label_, stage, text);
    shaders.push_back(compile(stage, text, files));
    glAttachShader(id(), shaders.back().id());
  }
  glLinkProgram(id());
  for (const Shader& shader : shaders) glDetachShader(id(), shader.id());
  if (const auto log = failure_log(id(), GL_LINK_STATUS))
    throw Error("shader program does not link", label_, name_files(*log, {}), 1);
  label_object(GL_PROGRAM, id(), label_);
  number_storage_blocks(most_blocks);
}

Program Program::compute(const std::string& file, const ShaderWords& words, const std::vector<std::string>& defines,
                         std::size_t most_blocks) {
  std::string label = file.substr(0, file.rfind('.'));
  if (const auto kind = words.words.find("KIND"); kind != words.words.end()) label += " " + kind->second;
  for (const Substitutions& item : words.each)
    if (const auto kind = item.find("KIND"); kind != item.end()) label += " " + kind->second;
  return Program(label, {file}, words, defines, most_blocks);
}

void Program::number_storage_blocks(std::size_t most) {
  GLint count = 0;
  glGetProgramInterfaceiv(id(), GL_SHADER_STORAGE_BLOCK, GL_ACTIVE_RESOURCES, &count);
  for (GLint k = 0; k < count; ++k) {
    std::string name(256, '\0');
    GLsizei length = 0;
    glGetProgramResourceName(id(), GL_SHADER_STORAGE_BLOCK, GLuint(k), GLsizei(name.size()), &length, name.data());
    storage_blocks_.push_back(name.substr(0, std::size_t(length)));
    glShaderStorageBlockBinding(id(), GLuint(k), GLuint(k));
  }
  if (storage_blocks_.size() > most)
    throw Error("a kernel has too many storage blocks",
                fmt::format("{} of at most {}: {}", storage_blocks_.size(), most, fmt::join(storage_blocks_, ", ")),
                "merge some, or leave out what it does not need", 1);
}

void Program::set_changed(const char* name, unsigned value) const {
  auto found = last_.find(std::string_view(name));
  if (found == last_.end()) found = last_.emplace(name, std::pair(glGetUniformLocation(id(), name), ~value)).first;
  auto& [location, last] = found->second;
  if (location >= 0 && last != value) glUniform1ui(location, value);
  last = value;
}

GLint Program::location(const char* name) const {
  if (const auto found = locations_.find(std::string_view(name)); found != locations_.end()) return found->second;
  const GLint location = glGetUniformLocation(id(), name);
  // A uniform that is declared and not used has no location either, but is no mistake.
  if (location < 0 && !std::regex_search(text_, std::regex(fmt::format("\nuniform [^;]*\\b{}\\b", name))))
    throw Error("no such uniform", fmt::format("'{}' in {}", name, label_),
                shader_folder().empty() ? "declare it in the shader" : "declare it in " + shader_folder(), 1);
  return locations_.emplace(name, location).first->second;
}

}  // namespace tetpbd
