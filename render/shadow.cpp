#include "render/shadow.h"

#include <array>
#include <cstddef>
#include <utility>

#include "render/layout.h"

namespace tetpbd {

void make_map(Shadow& shadow) {
  Texture depth("shadow depth");
  clear_errors();
  glTexImage2D(GL_TEXTURE_2D, 0, GL_DEPTH_COMPONENT32F, Shadow::size, Shadow::size, 0, GL_DEPTH_COMPONENT,
               GL_FLOAT, nullptr);
  check_memory("the shadow map", std::size_t(Shadow::size) * Shadow::size * 4);
  shadow.depth = std::move(depth);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAX_LEVEL, 0);
  shadow.framebuffer = Framebuffer("shadow");
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, shadow.depth.id(), 0);
  glDrawBuffer(GL_NONE);
  glReadBuffer(GL_NONE);
  const std::array<float, 4> lit{1.0f, 1.0f, 1.0f, 1.0f};
  shadow.compared = Sampler("shadow compared");
  shadow.plain = Sampler("shadow plain");
  for (const auto& [sampler, filter] :
       {std::pair{shadow.compared.id(), GL_LINEAR}, {shadow.plain.id(), GL_NEAREST}}) {
    for (GLenum wrap : {GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T})
      glSamplerParameteri(sampler, wrap, GL_CLAMP_TO_BORDER);
    for (GLenum size : {GL_TEXTURE_MIN_FILTER, GL_TEXTURE_MAG_FILTER})
      glSamplerParameteri(sampler, size, filter);
    glSamplerParameterfv(sampler, GL_TEXTURE_BORDER_COLOR, lit.data());
  }
  glSamplerParameteri(shadow.compared.id(), GL_TEXTURE_COMPARE_MODE, GL_COMPARE_REF_TO_TEXTURE);
  glSamplerParameteri(shadow.compared.id(), GL_TEXTURE_COMPARE_FUNC, GL_LEQUAL);
}

void fit(Shadow& shadow, const Program& kernel, GLuint positions, std::size_t vertices,
         const glm::vec4& limit) {
  if (!shadow.light) {
    shadow.bounds = Buffer("bounds", std::vector<std::uint32_t>{~0u, ~0u, ~0u, 0, 0, 0});
    shadow.light = Buffer("light", sizeof(Light));
    shadow.centre = Buffer("centre", sizeof(glm::vec4), nullptr, GL_STREAM_READ);
  }
  kernel.set("count", unsigned(vertices));
  kernel.set("map_size", float(Shadow::size));
  kernel.set("limit", limit);
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, BIND_RENDER_POSITIONS, positions);
  shadow.bounds.bind_storage(BIND_RENDER_BOUNDS);
  shadow.light.bind_storage(BIND_RENDER_FIT);
  for (int stage = 0; stage < 2; ++stage) {
    kernel.set("stage", stage);
    glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);  // the step's positions, then the bounds
    glDispatchCompute(stage == 0 ? unsigned(work_groups(vertices, 128)) : 1, 1, 1);
  }
  glMemoryBarrier(GL_UNIFORM_BARRIER_BIT);
}

void request_centre(Shadow& shadow) {
  if (shadow.centre_copied.sync()) return;
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  glBindBuffer(GL_COPY_READ_BUFFER, shadow.light.id());
  glBindBuffer(GL_COPY_WRITE_BUFFER, shadow.centre.id());
  glCopyBufferSubData(GL_COPY_READ_BUFFER, GL_COPY_WRITE_BUFFER, offsetof(Light, centre), 0,
                      sizeof(glm::vec4));
  shadow.centre_copied = Fence::here();
  glFlush();
}

}  // namespace tetpbd
