#include <assimp/DefaultIOSystem.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <fmt/format.h>

#include <assimp/DefaultLogger.hpp>
#include <assimp/Importer.hpp>
#include <assimp/LogStream.hpp>
#include <cmath>

#include "sim/mesh/bytes.h"
#include "sim/mesh/contained.h"
#include "sim/error.h"
#include "sim/mesh/surface_claims.h"
#include "sim/mesh/tet_mesh.h"
#include "sim/mesh/text_file.h"
#include "sim/mesh/weld.h"

namespace tetpbd {
namespace {

constexpr double weld_tolerance = 1e-7;  // of the bounding box's diagonal: about one step of a float

// assimp mends some damage in silence (an OFF index out of range becomes the last vertex) and only logs it.
struct FirstError : Assimp::LogStream {
  std::string text;
  void write(const char* message) override {
    if (text.empty() && std::string_view(message).find("OFF: ") != std::string_view::npos) text = message;
  }
};

// An OBJ names material files, which may be any path: only the mesh itself is opened.
struct OneFile : Assimp::DefaultIOSystem {
  std::string only;
  explicit OneFile(std::string file) : only(std::move(file)) {}
  bool Exists(const char* file) const override { return file == only && DefaultIOSystem::Exists(file); }
  Assimp::IOStream* Open(const char* file, const char* mode) override {
    return file == only ? DefaultIOSystem::Open(file, mode) : nullptr;
  }
};

std::runtime_error problem(const std::string& text) { return std::runtime_error(text); }

std::string one_line(std::string text) {
  for (char& c : text)
    if (static_cast<unsigned char>(c) < ' ') c = ' ';
  while (!text.empty() && text.back() == ' ') text.pop_back();
  for (std::size_t at; (at = text.find(": ")) != std::string::npos;)
    text.erase(at, 1);  // parts our own error line
  return text.substr(0, 300);
}

// Runs in the child. assimp's steps after reading index vertices unchecked, so indices are checked in
// between.
std::string read_with_assimp(const std::filesystem::path& file, const SurfaceClaims& claims) {
  Assimp::DefaultLogger::create("", Assimp::Logger::NORMAL, 0);
  auto* log = new FirstError;  // the logger owns it
  Assimp::DefaultLogger::get()->attachStream(log, Assimp::Logger::Err);
  Assimp::Importer importer;
  importer.SetIOHandler(new OneFile(file.string()));  // the importer owns it
  const aiScene* scene = importer.ReadFile(file.string(), 0);
  if (!scene) throw problem(one_line(importer.GetErrorString()));
  if (!log->text.empty()) throw problem(one_line(log->text));
  std::size_t vertices = 0, faces = 0;
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
    const aiMesh& mesh = *scene->mMeshes[m];
    vertices += mesh.mNumVertices;
    for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
      faces += mesh.mFaces[f].mNumIndices >= 3;  // where text ends early, assimp leaves faces empty
      for (unsigned k = 0; k < mesh.mFaces[f].mNumIndices; ++k)
        if (mesh.mFaces[f].mIndices[k] >= mesh.mNumVertices)
          throw problem(
              fmt::format("face {} names vertex {} of {}", f, mesh.mFaces[f].mIndices[k], mesh.mNumVertices));
    }
  }
  if (claims.faces && faces != *claims.faces)
    throw problem(fmt::format("the header claims {} faces, {} could be read", *claims.faces, faces));
  const bool indexed = lower_extension(file) == ".ply";  // the other readers unroll their vertices
  if (indexed && scene->mNumMeshes == 1 && claims.vertices && vertices != *claims.vertices)
    throw problem(fmt::format("the header claims {} vertices, {} could be read", *claims.vertices, vertices));

  scene = importer.ApplyPostProcessing(aiProcess_Triangulate);
  if (!scene) throw problem("its polygons could not be triangulated");
  SurfaceMesh surface;
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
    const aiMesh& mesh = *scene->mMeshes[m];
    const auto base = static_cast<std::uint32_t>(surface.positions.size());
    for (unsigned v = 0; v < mesh.mNumVertices; ++v)
      surface.positions.emplace_back(mesh.mVertices[v].x, mesh.mVertices[v].y, mesh.mVertices[v].z);
    for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
      const aiFace& face = mesh.mFaces[f];
      if (face.mNumIndices != 3) continue;  // points and lines
      surface.triangles.push_back(
          {base + face.mIndices[0], base + face.mIndices[1], base + face.mIndices[2]});
    }
  }
  std::string bytes;
  put_array(bytes, surface.positions);
  put_array(bytes, surface.triangles);
  return bytes;
}

}  // namespace

SurfaceMesh load_surface(const std::filesystem::path& file) {
  if (!is_surface_file(file))
    throw Error("not a surface format", file.string(), "use .ply, .obj, .stl or .off");
  require_readable(file);
  const SurfaceClaims claims = read_surface_claims(file);
  // On a loaded machine a megabyte takes 0.1 s; damaged files can keep assimp busy for ever.
  // A stated limit, with room for readers that unroll vertices and for the answer.
  const std::size_t size = std::filesystem::file_size(file);
  const double seconds = 8 + 1e-6 * static_cast<double>(size);
  const std::size_t memory = (std::size_t{512} << 20) + 200 * std::min(size, std::size_t{1} << 34);
  const ContainedResult answer =
      run_contained([&] { return read_with_assimp(file, claims); }, {seconds, memory});
  using End = ContainedResult::End;
  if (answer.end == End::refused)
    throw Error(fmt::format("file cannot be read ({})", answer.reason), file.string(),
                "it is damaged or not what its name says: fetch or export it again");
  if (answer.end != End::done)
    throw Error(fmt::format("reading failed ({})", answer.reason), file.string(),
                "it is damaged or too large: fetch or export it again");
  SurfaceMesh surface;
  std::string_view bytes = answer.bytes;
  if (!take_array(bytes, surface.positions) || !take_array(bytes, surface.triangles))
    throw Error("reading failed (its answer is incomplete)", file.string(), "try again");

  weld(surface, weld_tolerance * bounds(surface.positions).size());
  if (surface.triangles.empty())
    throw Error("file holds no triangle", file.string(), "export the surface as triangles or polygons");
  return surface;
}

}  // namespace tetpbd
