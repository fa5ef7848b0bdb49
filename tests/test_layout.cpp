// The structs C++ writes lie where GL reads them.
#include <doctest/doctest.h>
#include <unistd.h>

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <string>

#include "sim/error.h"
#include "sim/layout.h"
#include "sim/solvers/solver.h"
#include "tests/gl_test.h"

using namespace tetpbd;

namespace {

GLint property(const Program& program, GLenum interface, const std::string& name, GLenum what) {
  const GLuint index = glGetProgramResourceIndex(program.id(), interface, name.c_str());
  if (index == GL_INVALID_INDEX) return -1;
  GLint value = -1;
  glGetProgramResourceiv(program.id(), interface, index, 1, &what, 1, nullptr, &value);
  return value;
}

}  // namespace

TEST_CASE("struct offsets and strides are GL's") {
  GlTest gl;
  const Program predict = Program::compute("predict.comp", {}, {"COMPLIANT 1"});
  const auto variable = [&](const std::string& name) {
    return property(predict, GL_BUFFER_VARIABLE, name, GL_OFFSET);
  };
  CHECK(variable("positions[0].high") == offsetof(Position, high));
  CHECK(variable("positions[0].inverse_mass") == offsetof(Position, inverse_mass));
  CHECK(variable("positions[0].low") == offsetof(Position, low));
  CHECK(variable("velocities[0].high") == offsetof(Velocity, high));
  CHECK(variable("velocities[0].low") == offsetof(Velocity, low));
  CHECK(property(predict, GL_BUFFER_VARIABLE, "positions[0].high", GL_TOP_LEVEL_ARRAY_STRIDE) ==
        sizeof(Position));
  CHECK(property(predict, GL_BUFFER_VARIABLE, "velocities[0].high", GL_TOP_LEVEL_ARRAY_STRIDE) ==
        sizeof(Velocity));

  const auto paper = [](Substitutions words) {
    return Program::compute("solve_paper.comp", {words, {}}, {"GROUP_SIZE 1024", "COUNT 7"});
  };
  const Program volume = paper({{"KIND", "volume"}, {"ARITY", "4"}, {"KIND_ROW", "0"}, {"KIND_COLUMN", "2"}});
  CHECK(property(volume, GL_BUFFER_VARIABLE, "records[0].rest", GL_OFFSET) ==
        offsetof(layout::Record4, rest));
  CHECK(property(volume, GL_BUFFER_VARIABLE, "records[0].rest", GL_TOP_LEVEL_ARRAY_STRIDE) ==
        sizeof(layout::Record4));
  const Program stretch =
      paper({{"KIND", "stretch"}, {"ARITY", "2"}, {"KIND_ROW", "0"}, {"KIND_COLUMN", "0"}});
  CHECK(property(stretch, GL_BUFFER_VARIABLE, "records[0].rest", GL_TOP_LEVEL_ARRAY_STRIDE) ==
        sizeof(layout::Record2));

  const auto uniform = [&](const char* name) {
    return property(predict, GL_UNIFORM, std::string("StepBlock.") + name, GL_OFFSET);
  };
  const auto nested = [&](const char* name) {  // an instance-less block names its members plainly
    const GLint plain = property(predict, GL_UNIFORM, std::string("params.") + name, GL_OFFSET);
    return plain >= 0 ? plain : uniform(name);
  };
  CHECK(nested("gravity") == offsetof(Step, gravity));
  CHECK(nested("h") == offsetof(Step, h));
  CHECK(nested("velocity_scale") == offsetof(Step, velocity_scale));
  CHECK(nested("max_correction") == offsetof(Step, max_correction));
  CHECK(nested("vertex_count") == offsetof(Step, vertex_count));
  CHECK(nested("quantum") == offsetof(Step, quantum));
  CHECK(nested("quantized_size") == offsetof(Step, quantized_size));
  CHECK(nested("plane_count") == offsetof(Step, plane_count));
  CHECK(nested("stiffness[0]") == offsetof(Step, stiffness));
  CHECK(nested("planes[0]") == offsetof(Step, planes));
  CHECK(nested("compliance[0]") == offsetof(Step, compliance));
  CHECK(nested("damping") == offsetof(Step, damping));
  CHECK(property(predict, GL_UNIFORM_BLOCK, "StepBlock", GL_BUFFER_DATA_SIZE) == sizeof(Step));
}

TEST_CASE("a shader that does not compile names its file and line") {
  GlTest gl;
  const std::string folder = "/tmp/tetpbd_shader_test_" + std::to_string(getpid());
  std::filesystem::create_directories(folder);
  for (const char* name : {"types.glsl", "layout.glsl", "pair.glsl"}) {
    std::ofstream(folder + "/" + name) << "";
  }
  std::ofstream(folder + "/predict.comp")
      << "layout(local_size_x = 1) in;\n#include \"pair.glsl\"\nvoid main() { float a = nonsense; }\n";
  set_shader_folder(folder);
  CHECK(shader_folder_version() != 0);
  std::string message;
  try {
    Program::compute("predict.comp");
  } catch (const Error& error) {
    message = error.what();
  }
  set_shader_folder("");
  std::filesystem::remove_all(folder);
  CHECK(message.find("predict.comp:3") != std::string::npos);
  CHECK(message.find("nonsense") != std::string::npos);
  CHECK_THROWS_AS(set_shader_folder("/no/such/folder"), Error);
  gl.errors = gl_error_count();  // the driver reports the compile error through the debug output too
}

TEST_CASE("#include, #foreach and words expand") {
  std::vector<std::string> files;
  const std::string text = shader_text("solve_node.comp",
                                       {{},
                                        {{{"KIND", "stretch"},
                                          {"ARITY", "2"},
                                          {"INDEX", "0"},
                                          {"KIND_ROW", "0"},
                                          {"KIND_COLUMN", "0"},
                                          {"PROJECT", "project"},
                                          {"PAIRS", "1"},
                                          {"MATERIAL", "0"}},
                                         {{"KIND", "bend"},
                                          {"ARITY", "4"},
                                          {"INDEX", "1"},
                                          {"KIND_ROW", "0"},
                                          {"KIND_COLUMN", "0"},
                                          {"PROJECT", "project"},
                                          {"PAIRS", "3"},
                                          {"MATERIAL", "1"}}}},
                                       files);
  CHECK(text.find("project_stretch(records_stretch.x + 1 * (t - begin_stretch), chunk.owned)") !=
        std::string::npos);
  CHECK(text.find("project_bend(records_bend.x + 3 * (t - begin_bend), chunk.owned)") != std::string::npos);
  CHECK(text.find("project_volume") == std::string::npos);
  CHECK(text.find("#include") == std::string::npos);
  CHECK(text.find("$KIND") == std::string::npos);
}
