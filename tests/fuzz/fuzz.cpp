// A libFuzzer program for all readers: FUZZ_READER names the one to feed.
#include <fmt/format.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>

#include "tests/fuzz/readers.h"

namespace {

const fuzz::Reader& chosen() {
  const char* wanted = std::getenv("FUZZ_READER");
  for (const fuzz::Reader& reader : fuzz::readers())
    if (wanted && std::strcmp(reader.name, wanted) == 0) return reader;
  fmt::print(stderr, "set FUZZ_READER to one of:");
  for (const fuzz::Reader& reader : fuzz::readers()) fmt::print(stderr, " {}", reader.name);
  fmt::print(stderr, "\n");
  std::exit(2);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const fuzz::Reader& reader = chosen();
  reader.read({reinterpret_cast<const char*>(data), size});
  return 0;
}
