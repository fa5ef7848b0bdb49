// The program itself, run with a command line in a folder of its own.
#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

namespace run_program {

namespace fs = std::filesystem;

struct Folder {
  fs::path path = fs::temp_directory_path() / ("tetpbd_run_" + std::to_string(getpid()));
  Folder() { fs::create_directories(path); }
  ~Folder() { fs::remove_all(path); }
};

inline std::string read(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

struct Outcome {
  int status;
  std::string out, err;
};

inline Outcome program(const std::string& arguments, const Folder& folder, const std::string& environment = "") {
  const std::string out = (folder.path / "stdout").string(), err = (folder.path / "stderr").string();
  const int status = std::system(("cd " + folder.path.string() + " && " + environment + " " TEST_PROGRAM " " +
                                  arguments + " >" + out + " 2>" + err)
                                     .c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read(out), read(err)};
}

}  // namespace run_program
