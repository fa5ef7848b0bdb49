#include "render/shadow.h"

#include <array>
#include <utility>

#include "render/layout.h"

namespace tetpbd {

void make_bounds(Shadow& shadow) {
  shadow.bounds_kernel = Program::compute("render/bounds.comp");
  shadow.fit_kernel = Program::compute("render/shadow_fit.comp");
  shadow.bounds = Buffer("bounds", std::vector<std::uint32_t>{~0u, ~0u, ~0u, 0, 0, 0});
  shadow.light = Buffer("light", sizeof(Light));
}

void make_map(Shadow& shadow) {
  Texture depth = Texture::make("shadow depth");
  clear_errors();
  glTexImage2D(GL_TEXTURE_2D, 0, GL_DEPTH_COMPONENT32F, Shadow::size, Shadow::size, 0, GL_DEPTH_COMPONENT,
               GL_FLOAT, nullptr);
  check_memory("the shadow map", std::size_t(Shadow::size) * Shadow::size * 4);
  shadow.depth = std::move(depth);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAX_LEVEL, 0);
  shadow.framebuffer = Framebuffer::make("shadow");
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, shadow.depth.id(), 0);
  glDrawBuffer(GL_NONE);
  glReadBuffer(GL_NONE);
  const std::array<float, 4> lit{1.0f, 1.0f, 1.0f, 1.0f};
  shadow.compared = Sampler::make("shadow compared");
  shadow.plain = Sampler::make("shadow plain");
  for (GLuint sampler : {shadow.compared.id(), shadow.plain.id()}) {
    glSamplerParameteri(sampler, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_BORDER);
    glSamplerParameteri(sampler, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_BORDER);
    glSamplerParameterfv(sampler, GL_TEXTURE_BORDER_COLOR, lit.data());
  }
  glSamplerParameteri(shadow.compared.id(), GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  glSamplerParameteri(shadow.compared.id(), GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  glSamplerParameteri(shadow.compared.id(), GL_TEXTURE_COMPARE_MODE, GL_COMPARE_REF_TO_TEXTURE);
  glSamplerParameteri(shadow.compared.id(), GL_TEXTURE_COMPARE_FUNC, GL_LEQUAL);
  glSamplerParameteri(shadow.plain.id(), GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  glSamplerParameteri(shadow.plain.id(), GL_TEXTURE_MAG_FILTER, GL_NEAREST);
}

void fit(const Shadow& shadow, GLuint positions, std::size_t vertices, const glm::vec4& limit) {
  shadow.bounds_kernel.use();
  shadow.bounds_kernel.set("count", unsigned(vertices));
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, BIND_RENDER_POSITIONS, positions);
  shadow.bounds.bind_storage(BIND_RENDER_BOUNDS);
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);  // the step's positions
  glDispatchCompute(unsigned(work_groups(vertices, 128)), 1, 1);

  shadow.fit_kernel.use();
  shadow.fit_kernel.set("map_size", float(Shadow::size));
  shadow.fit_kernel.set("limit", limit);
  shadow.light.bind_storage(BIND_RENDER_FIT);
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
  glDispatchCompute(1, 1, 1);
  glMemoryBarrier(GL_UNIFORM_BARRIER_BIT);
}

}  // namespace tetpbd
