#include "sim/gl/pass.h"

#include <fmt/format.h>

#include <algorithm>

#include "sim/error.h"

namespace tetpbd {

void check_block(const std::string& label, std::size_t bytes, std::size_t most) {
  if (bytes > most)
    throw Error("a storage buffer is too large",
                fmt::format("'{}' of {} bytes, the driver allows {}", label, bytes, most), "use a smaller mesh", 1);
}

std::size_t Recorder::place(const std::string& block) {
  const std::size_t at = std::size_t(std::ranges::find(names_, block) - names_.begin());
  if (at == names_.size()) names_.push_back(block), ranges_.emplace_back();
  return at;
}

void Recorder::give(const std::string& block, GLuint buffer, std::size_t first, std::size_t bytes) {
  ranges_[place(block)] = {buffer, first, bytes};
}

void Recorder::give(const std::string& block, const Buffer& buffer) {
  if (storage == 0) storage = std::size_t(capabilities().storage_bytes);
  check_block(buffer.label(), buffer.bytes(), storage);
  give(block, buffer.id());
}

const Program& Recorder::use(const Program& program) {
  if (program.id() != program_) program.use(), program_ = program.id();
  return program;
}

DispatchCount& Recorder::count(const Pass& pass, const char* what, std::size_t bytes) {
  const std::string name = pass.label() + what;
  const auto found = std::ranges::find(counted, name, &DispatchCount::name);
  DispatchCount& kept = found == counted.end() ? counted.emplace_back() : *found;
  // Dispatches of one name may differ in size, as those of colours do.
  kept.work_groups = std::max(kept.work_groups, pass.work_groups);
  kept.name = name, kept.bytes = pass.bytes + bytes;
  ++kept.dispatches;
  return kept;
}

void Recorder::run(Pass& pass, std::initializer_list<DispatchParameter> parameters, const char* what,
                   std::size_t bytes) {
  give_turn();
  const std::vector<std::string>& blocks = pass.program.storage_blocks();
  if (pass.recorder != this) {
    pass.recorder = this, pass.places.clear();
    for (const std::string& block : blocks) pass.places.push_back(place(block));
  }
  use(pass.program);
  if (pass.records) give("Records", pass.records);
  bound_.resize(std::max(bound_.size(), blocks.size()));
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    const Range& range = ranges_[pass.places[k]];
    if (range.buffer == 0)
      throw Error("a kernel lacks a buffer", fmt::format("'{}' of {}", blocks[k], pass.label()),
                  "give one by that name", 1);
    if (bound_[k] == range) continue;
    bound_[k] = range;
    if (range.bytes)
      glBindBufferRange(GL_SHADER_STORAGE_BUFFER, GLuint(k), range.buffer, GLintptr(range.first),
                        GLsizeiptr(range.bytes));
    else
      glBindBufferBase(GL_SHADER_STORAGE_BUFFER, GLuint(k), range.buffer);
  }
  for (const DispatchParameter& parameter : parameters) pass.program.set_changed(parameter.name, parameter.value);
  DispatchCount* counted_as = counting || timing ? &count(pass, what, bytes) : nullptr;
  if (timing) counted_as->timer.begin();
  if (pass.work_groups) {
    if (row == 0) row = most_work_groups_in_row();
    const std::size_t in_row = std::min(pass.work_groups, row);  // group_index in types.glsl counts over rows
    glDispatchCompute(GLuint(in_row), GLuint((pass.work_groups + in_row - 1) / in_row), 1);
  } else if (pass.grid.x) {
    glDispatchCompute(pass.grid.x, pass.grid.y, pass.grid.z);
  } else {
    glBindBuffer(GL_DISPATCH_INDIRECT_BUFFER, counts);
    glDispatchComputeIndirect(GLintptr(pass.counts_at));
  }
  barrier(GL_SHADER_STORAGE_BARRIER_BIT);
  if (timing) counted_as->timer.end();
}

}  // namespace tetpbd
