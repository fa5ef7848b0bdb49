// Every reader against the corpus, and against seeded mutations of it: a bounded share of what
// tests/fuzz/run.sh does for hours. A broken promise ends the process with a message; a crash and a leak are
// the sanitizers' to report.
#include <doctest/doctest.h>
#include <stdlib.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>

#include "tests/fuzz/readers.h"
#include "tests/long_run.h"

namespace fs = std::filesystem;

namespace {

std::vector<std::string> corpus_of(const fuzz::Reader& reader) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(fs::path(TEST_CORPUS) / reader.corpus)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  std::vector<std::string> contents;
  for (const fs::path& file : files) {
    std::ifstream stream(file, std::ios::binary);
    contents.emplace_back(std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>());
  }
  return contents;
}

struct Mutator {
  std::mt19937 generator;
  std::size_t below(std::size_t limit) { return limit == 0 ? 0 : generator() % limit; }

  // Numbers where readers go wrong, in place of one that stands there.
  void change_number(std::string& bytes) {
    static constexpr const char* numbers[] = {
        "-1",         "0",          "1",     "2147483648", "4294967295",
        "4294967296", "1e308",      "nan",   "-inf",       "9223372036854775807",
        "1e-320",     "1000000000", "0.125", "",           "18446744073709551616"};
    static constexpr const char* digits = "0123456789.-";
    const std::size_t first = bytes.find_first_of(digits, below(bytes.size()));
    if (first == std::string::npos) return;
    const std::size_t last = std::min(bytes.find_first_not_of(digits, first), bytes.size());
    bytes.replace(first, last - first, numbers[below(std::size(numbers))]);
  }
  // Four bytes, as in binary counts and indices.
  void change_word(std::string& bytes) {
    static constexpr unsigned words[] = {0, 1, 0x7fffffff, 0x80000000, 0xffffffff, 0x7f800000, 0x7fc00000, 0x00ffffff};
    const unsigned word = words[below(std::size(words))];
    const std::size_t at = below(bytes.size());
    for (std::size_t k = 0; k < 4 && at + k < bytes.size(); ++k) bytes[at + k] = static_cast<char>(word >> (8 * k));
  }
  std::string part_of(const std::string& bytes) {
    const std::size_t first = below(bytes.size());
    return bytes.substr(first, 1 + below(std::min<std::size_t>(64, bytes.size() - first)));
  }
  std::string mutated(const std::vector<std::string>& corpus) {
    std::string bytes = corpus[below(corpus.size())];
    for (std::size_t n = 1 + below(4); n > 0; --n) {
      const std::size_t at = below(bytes.size());
      switch (below(7)) {
        case 0:
          change_number(bytes);
          break;
        case 1:
          change_word(bytes);
          break;
        case 2:
          bytes.insert(at, part_of(corpus[below(corpus.size())]));
          break;
        case 3:
          bytes.insert(at, part_of(bytes));
          break;
        case 4:
          bytes.erase(at, 1 + below(16));
          break;
        case 5:
          bytes.resize(at);
          break;
        default:
          if (!bytes.empty()) bytes[at] = static_cast<char>(bytes[at] ^ (1 << below(8)));
      }
    }
    return bytes;
  }
};

/// Reading the command line sets these.
struct Environment {
  std::string models, cache;
  static std::string value(const char* name) { return ::getenv(name) ? ::getenv(name) : ""; }
  static void restore(const char* name, const std::string& value) {
    value.empty() ? ::unsetenv(name) : ::setenv(name, value.c_str(), 1);
  }
  Environment() : models(value("TETPBD_MODELS")), cache(value("TETPBD_CACHE")) {}
  ~Environment() { restore("TETPBD_MODELS", models), restore("TETPBD_CACHE", cache); }
};

}  // namespace

TEST_CASE("fuzz: every reader takes its corpus, or refuses it in one line") {
  const Environment restored;
  for (const fuzz::Reader& reader : fuzz::readers()) {
    CAPTURE(reader.name);
    const auto corpus = corpus_of(reader);
    CHECK(corpus.size() >= 5);
    for (const std::string& bytes : corpus) reader.read(bytes);
  }
}

TEST_CASE("fuzz: and mutations of it") {
  const Environment restored;
  const int factor = std::max(is_long_run() ? 20 : 1, std::atoi(Environment::value("FUZZ_FACTOR").c_str()));
  for (const fuzz::Reader& reader : fuzz::readers()) {
    CAPTURE(reader.name);
    const auto corpus = corpus_of(reader);
    Mutator mutator{std::mt19937(seed_of_run(20261121))};
    const int few = reader.forks ? 30 : std::string_view(reader.name) == "words" ? 100 : 1000;
    const int runs = few * factor;
    for (int run = 0; run < runs; ++run) {
      CAPTURE(run);
      reader.read(mutator.mutated(corpus));
    }
  }
}
