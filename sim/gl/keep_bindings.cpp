#include "sim/gl/keep_bindings.h"

#include "sim/error.h"
#include "sim/gl/context.h"
#include "sim/gl/layout.h"

namespace tetpbd {

namespace {

constexpr GLenum units[] = {GL_TEXTURE0 + UNIT_FIELDS, GL_TEXTURE0 + UNIT_SURFACES, GL_TEXTURE0 + UNIT_QUANTA,
                            GL_TEXTURE0 + UNIT_LOADS, GL_TEXTURE0 + UNIT_LISTED};

// Targets and what to ask for their buffers; glBindBufferBase() binds to the generic target as well.
constexpr GLenum targets[][2] = {{GL_COPY_READ_BUFFER, GL_COPY_READ_BUFFER},
                                 {GL_COPY_WRITE_BUFFER, GL_COPY_WRITE_BUFFER},
                                 {GL_UNIFORM_BUFFER, GL_UNIFORM_BUFFER_BINDING},
                                 {GL_SHADER_STORAGE_BUFFER, GL_SHADER_STORAGE_BUFFER_BINDING},
                                 {GL_ATOMIC_COUNTER_BUFFER, GL_ATOMIC_COUNTER_BUFFER_BINDING},
                                 {GL_DISPATCH_INDIRECT_BUFFER, GL_DISPATCH_INDIRECT_BUFFER_BINDING}};

}  // namespace

KeepBindings::KeepBindings() {
  if (!glDispatchCompute) load_gl();
  glGetIntegerv(GL_ACTIVE_TEXTURE, &unit_);
  if (unit_ == 0) {  // 0 in no context that works
    check_context();
    throw Error("no OpenGL context is current", "this thread", "make one current before the call", 1);
  }
  glGetIntegerv(GL_CURRENT_PROGRAM, &program_);
  if (program_) {  // a deleted one lives only as long as it is in use, so it cannot be put back
    GLint deleted = 0;
    glGetProgramiv(GLuint(program_), GL_DELETE_STATUS, &deleted);
    if (deleted) program_ = 0;
  }
  for (std::size_t k = 0; k < std::size(targets); ++k) glGetIntegerv(targets[k][1], &buffers_[k]);
  glGetIntegerv(GL_TEXTURE_BINDING_BUFFER, &texture_);
  for (std::size_t k = 0; k < std::size(units); ++k) {
    glActiveTexture(units[k]);
    glGetIntegerv(GL_TEXTURE_BINDING_BUFFER, &textures_[k]);
  }
  glActiveTexture(GLenum(unit_));
}

// An object that was deleted since can no longer be bound.
KeepBindings::~KeepBindings() {
  for (std::size_t k = 0; k < std::size(targets); ++k) {
    const GLuint buffer = GLuint(buffers_[k]);
    glBindBuffer(targets[k][0], buffer && glIsBuffer(buffer) ? buffer : 0);
  }
  const auto bind_texture = [](GLenum unit, GLint name) {
    glActiveTexture(unit);
    glBindTexture(GL_TEXTURE_BUFFER, name && glIsTexture(GLuint(name)) ? GLuint(name) : 0);
  };
  for (std::size_t k = 0; k < std::size(units); ++k) bind_texture(units[k], textures_[k]);
  bind_texture(GLenum(unit_), texture_);
  const GLuint program = GLuint(program_);
  glUseProgram(program && glIsProgram(program) ? program : 0);
}

}  // namespace tetpbd
