// Linked programs, made of shader files: from inside this program or from a folder.
#pragma once

#include <glm/glm.hpp>
#include <map>
#include <vector>

#include "sim/gl/object.h"

namespace tetpbd {

/// Values of `$NAME` in a shader's text, put in before it is compiled: {"KIND", "stretch"} makes gather_$KIND
/// gather_stretch.
using Substitutions = std::map<std::string, std::string>;
/// `words` for the whole text; `each`: a line that starts with #foreach is repeated once for every entry,
/// with its words.
struct ShaderWords {
  Substitutions words;
  std::vector<Substitutions> each;
};

/// Reads shaders from this folder instead of the ones inside the program (empty: inside). The variable
/// TETPBD_SHADERS sets it at start.
void set_shader_folder(const std::string& folder);
const std::string& shader_folder();
/// Changes when a file of the folder changes; 0 without a folder.
std::int64_t shader_folder_version();

/// The text of shaders/`name`, #include, #foreach and `$NAME` expanded. `files`: the files it is made of, in
/// order; line N of files[I] stands under #line N I (GLSL has numbers where C has names).
std::string shader_text(const std::string& name, const ShaderWords& words, std::vector<std::string>& files);

inline void delete_program(GLuint id) { glDeleteProgram(id); }

/// A linked program. Errors name the shader file and line.
class Program {
 public:
  struct Stage {
    GLenum type;
    std::string file;
  };
  Program() = default;
  /// `#define`s and `#version 430 core` are put before each stage.
  Program(std::string label, const std::vector<Stage>& stages, const ShaderWords& words = {},
          const std::vector<std::string>& defines = {});
  static Program compute(const std::string& file, const ShaderWords& words = {},
                         const std::vector<std::string>& defines = {});

  GLuint id() const { return object_.name(); }
  const std::string& label() const { return label_; }
  explicit operator bool() const { return id() != 0; }
  void use() const { glUseProgram(id()); }
  /// Sets a uniform of the program in use. One that the linker dropped is ignored; one that its text does not
  /// declare throws Error.
  void set(const char* name, int value) const { glUniform1i(location(name), value); }
  void set(const char* name, unsigned value) const { glUniform1ui(location(name), value); }
  void set(const char* name, float value) const { glUniform1f(location(name), value); }
  void set(const char* name, const glm::uvec2& value) const { glUniform2uiv(location(name), 1, &value.x); }
  void set(const char* name, const glm::vec3& value) const { glUniform3fv(location(name), 1, &value.x); }
  void set(const char* name, const glm::vec4& value) const { glUniform4fv(location(name), 1, &value.x); }

 private:
  GLint location(const char* name) const;
  Owned<GLuint, delete_program> object_;
  std::string label_;
  std::string declarations_;  ///< the lines that declare uniforms
  mutable std::map<std::string, GLint, std::less<>> locations_;
};

}  // namespace tetpbd
