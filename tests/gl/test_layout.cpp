// The structs C++ writes lie where GL reads them.
#include <doctest/doctest.h>
#include <unistd.h>

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>

#include "sim/contact/pair_layout.h"
#include "sim/error.h"
#include "sim/gl/layout.h"
#include "sim/model/material.h"
#include "sim/solvers/newton_buffers.h"
#include "tests/gl_test.h"
#include "tests/sim_samples.h"

using namespace tetpbd;

namespace {

GLint property(const Program& program, GLenum interface, const std::string& name, GLenum what) {
  const GLuint index = glGetProgramResourceIndex(program.id(), interface, name.c_str());
  if (index == GL_INVALID_INDEX) return -1;
  GLint value = -1;
  glGetProgramResourceiv(program.id(), interface, index, 1, &what, 1, nullptr, &value);
  return value;
}

// That each member of a storage block lies where the layout says, and has its size, where it has one.
void check_block(const Program& program, const char* block, const BufferLayout& layout) {
  CAPTURE(program.label());
  CAPTURE(block);
  const GLuint index = glGetProgramResourceIndex(program.id(), GL_SHADER_STORAGE_BLOCK, block);
  if (index == GL_INVALID_INDEX) return;  // the kernel does not use it
  struct Member {
    std::size_t at, bytes;
  };
  std::map<std::string, Member> members;  // those of structs come apart
  GLint variables = 0;
  glGetProgramInterfaceiv(program.id(), GL_BUFFER_VARIABLE, GL_ACTIVE_RESOURCES, &variables);
  for (GLuint v = 0; v < GLuint(variables); ++v) {
    std::string name(100, '\0');
    GLsizei length = 0;
    glGetProgramResourceName(program.id(), GL_BUFFER_VARIABLE, v, GLsizei(name.size()), &length, name.data());
    name.resize(std::size_t(length));
    const auto ask = [&](GLenum what) { return property(program, GL_BUFFER_VARIABLE, name, what); };
    if (GLuint(ask(GL_BLOCK_INDEX)) != index) continue;
    const Member part{std::size_t(ask(GL_OFFSET)),
                      std::size_t(ask(GL_TOP_LEVEL_ARRAY_SIZE) * ask(GL_TOP_LEVEL_ARRAY_STRIDE))};
    Member& member = members.emplace(name.substr(0, name.find_first_of("[.")), part).first->second;
    member.at = std::min(member.at, part.at);
  }
  CHECK(members.size() == layout.members.size());
  for (const auto& [name, at, bytes] : layout.members) {
    CAPTURE(name);
    REQUIRE(members.contains(name));
    CHECK(members[name].at == at);
    if (members[name].bytes > 0) CHECK(members[name].bytes == bytes);
  }
  CHECK(std::size_t(property(program, GL_SHADER_STORAGE_BLOCK, block, GL_BUFFER_DATA_SIZE)) <= layout.bytes);
}

}  // namespace

TEST_CASE("struct offsets and strides are GL's") {
  GlTest gl;
  const Program predict = Program::compute("solvers/predict.comp", {{{"SCHEME", "corrections"}}, {}},
                                           {"COMPLIANT 1", "LEAPFROG 1", "SOLIDS 0"});
  const auto variable = [&](const std::string& name) { return property(predict, GL_BUFFER_VARIABLE, name, GL_OFFSET); };
  CHECK(variable("positions[0].high") == offsetof(Position, high));
  CHECK(variable("positions[0].inverse_mass") == offsetof(Position, inverse_mass));
  CHECK(variable("positions[0].low") == offsetof(Position, low));
  CHECK(variable("velocities[0].high") == offsetof(Velocity, high));
  CHECK(variable("velocities[0].low") == offsetof(Velocity, low));
  CHECK(property(predict, GL_BUFFER_VARIABLE, "positions[0].high", GL_TOP_LEVEL_ARRAY_STRIDE) == sizeof(Position));
  CHECK(property(predict, GL_BUFFER_VARIABLE, "velocities[0].high", GL_TOP_LEVEL_ARRAY_STRIDE) == sizeof(Velocity));

  const auto paper = [](Substitutions words) {
    return Program::compute("solvers/paper.comp", {words, {}}, {"GROUP_SIZE 1024", "COUNT 7"});
  };
  const Program volume = paper({{"KIND", "volume"}, {"ARITY", "4"}, {"KIND_ROW", "0"}, {"KIND_COLUMN", "2"}});
  CHECK(property(volume, GL_BUFFER_VARIABLE, "records[0].rest", GL_OFFSET) == offsetof(layout::Record4, rest));
  CHECK(property(volume, GL_BUFFER_VARIABLE, "records[0].rest", GL_TOP_LEVEL_ARRAY_STRIDE) == sizeof(layout::Record4));
  const Program stretch = paper({{"KIND", "stretch"}, {"ARITY", "2"}, {"KIND_ROW", "0"}, {"KIND_COLUMN", "0"}});
  CHECK(property(stretch, GL_BUFFER_VARIABLE, "records[0].rest", GL_TOP_LEVEL_ARRAY_STRIDE) == sizeof(layout::Record2));

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

TEST_CASE("members of mode newton's blocks lie where GL reads them, and no array is empty") {
  GlTest gl;
  const auto model = samples::block_model({3, 2, 1});
  for (const bool material : {false, true}) {
    Settings settings;
    if (material) settings.material = "neo-hookean", settings.constraint_damping = 0.01;
    const ConstraintSystem system = build_constraints(model->rest, settings);
    const SolverInput input{*model, system, settings, plan_for(settings), {}};
    NewtonSizes all = measure_newton(input, build_newton_levels(*model, system));
    NewtonSizes odd = all, none = all;  // what is behind a list of odd length may have to be aligned
    odd.aggregates = 3, odd.members = 7, odd.uses = 5, odd.bodies = 3, odd.free_bodies = 1, odd.parts = 3;
    odd.product_groups = 1;
    none.aggregates = none.members = none.uses = none.free_bodies = none.edges = 0;
    for (const NewtonSizes& sizes : {all, odd, none}) {
      const NewtonBuffers layout = lay_out_newton_buffers(sizes, system);
      for (const char* name : {"begin", "predict", "start", "linearise", "residual", "update", "coarse", "prolong",
                               "product", "finish", "momentum", "place"}) {
        const Program program = Program::compute(std::string("solvers/newton/") + name + ".comp",
                                                 {{}, kind_words(system)}, newton_defines(sizes, input));
        check_block(program, "Mesh", layout.mesh);
        check_block(program, "Coarse", layout.coarse);
        check_block(program, "Sums", layout.sums);
      }
    }
  }
}

TEST_CASE("members of the blocks of contact lie where GL reads them, and no array is empty") {
  GlTest gl;
  const PairSizes sheet{.triangles = 7, .edges = 13, .surface_vertices = 9, .vertices = 9, .places = 18, .leaves = 1};
  PairSizes solid = sheet;
  solid.triangles = 5, solid.edges = 6, solid.vertices = 11, solid.leaves = 3;
  for (const PairSizes& sizes : {sheet, solid}) {
    const PairRanges layout = lay_out_pairs(sizes);
    std::vector<std::string> defines = pair_defines(sizes);
    defines.insert(defines.end(), {"COMPLIANT 1", "LEAPFROG 1", "RIGID_CONTACT 0", "SOLIDS 0", "FIELDS 0", "CONTACTS 1",
                                   "IMPLICIT 0", "BEFORE_SUBSTEP 0", "CONTACT_SELF 1", "ROW 9u", "GROUP_SIZE 64u",
                                   "FIND_GROUP 128u", "PAIR_GROUP 64u", "TOTAL_MASS 1.0", "BODY_SURFACES 0"});
    for (const char* name : {"boxes", "near", "cull", "find", "list", "impulses", "truncate"}) {
      const Program program =
          Program::compute(std::string("contact/bodies/") + name + ".comp", {{{"SCHEME", "leapfrog"}}, {}}, defines);
      check_block(program, "PairMesh", layout.mesh);
      check_block(program, "PairLists", layout.lists);
    }
  }
}

TEST_CASE("a shader that does not compile names its file and line") {
  GlTest gl;
  const std::string folder = "/tmp/tetpbd_shader_test_" + std::to_string(getpid());
  std::filesystem::create_directories(folder);
  for (const char* name : {"types.glsl", "layout.glsl", "double_single.glsl"}) {
    std::ofstream(folder + "/" + name) << "";
  }
  std::ofstream(folder + "/predict.comp") << "layout(local_size_x = 1) in;\n#include "
                                             "\"double_single.glsl\"\nvoid main() { float a = nonsense; }\n";
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
  const std::string text = shader_text("solvers/node.comp",
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
  CHECK(text.find("project_stretch(records_stretch.x + 1 * (t - begin_stretch), owned)") != std::string::npos);
  CHECK(text.find("project_bend(records_bend.x + 3 * (t - begin_bend), owned)") != std::string::npos);
  CHECK(text.find("project_volume") == std::string::npos);
  CHECK(text.find("#include") == std::string::npos);
  CHECK(text.find("$KIND") == std::string::npos);
}
