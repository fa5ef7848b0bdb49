// Loops over independent items on several cores (OpenMP). Results never depend on how many.
#pragma once

#include <omp.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <parallel/algorithm>
#include <span>
#include <utility>
#include <vector>

namespace tetpbd {

/// Threads of a loop: the cores this process may use, at most 16 (loading is then bound by memory).
inline std::size_t thread_count() { return std::size_t(std::clamp(omp_get_max_threads(), 1, 16)); }

/// Calls f(first, end) for parts of 0 .. count that follow each other, one a thread and `least` items or more
/// each; what f writes must depend on the item alone. Rethrows what the first part that failed threw.
template <class F>
void parallel_parts(std::size_t count, std::size_t least, F&& f) {
  const std::size_t parts = std::clamp<std::size_t>(count / least, 1, thread_count());
  std::vector<std::exception_ptr> failed(parts);
#pragma omp parallel for num_threads(int(parts)) schedule(static, 1)
  for (std::size_t part = 0; part < parts; ++part) try {
      f(count * part / parts, count * (part + 1) / parts);
    } catch (...) {
      failed[part] = std::current_exception();
    }
  for (const std::exception_ptr& e : failed)
    if (e) std::rethrow_exception(e);
}

/// Calls f(item) for 0 .. count, `least` items or more to a thread.
template <class F>
void parallel_for(std::size_t count, F&& f, std::size_t least = 8192) {
  parallel_parts(count, least, [&](std::size_t first, std::size_t end) {
    for (std::size_t i = first; i < end; ++i) f(i);
  });
}

/// Sorts items none of which are equal.
template <class T>
void parallel_sort(std::span<T> items) {
  __gnu_parallel::sort(items.begin(), items.end());
}

/// Values by key: those of k are values[first[k]] .. values[first[k + 1]], in the order of their items.
struct Grouped {
  std::vector<std::uint32_t> first, values;
};
/// Counting sort. each(item, emit) calls emit(key, value), the same each time; fewer than 2^32 values in all.
template <class Each>
Grouped group_by_key(std::size_t items, std::size_t keys, Each&& each) {
  const std::size_t parts = std::clamp<std::size_t>(items / 65536, 1, thread_count());
  std::vector<std::vector<std::uint32_t>> at(parts);  // by part and key: how many, then where the next goes
  const auto each_part = [&](const auto& visit) {
    parallel_parts(parts, 1, [&](std::size_t part, std::size_t) {
      at[part].resize(keys);
      for (std::size_t i = items * part / parts; i < items * (part + 1) / parts; ++i)
        each(i, [&](std::uint32_t key, std::uint32_t value) { visit(at[part][key], value); });
    });
  };
  each_part([](std::uint32_t& count, std::uint32_t) { ++count; });
  Grouped result;
  std::uint32_t total = 0;
  for (std::size_t key = 0; key < keys; ++key) {
    result.first.push_back(total);
    for (auto& counts : at) total += std::exchange(counts[key], total);
  }
  result.first.push_back(total);
  result.values.resize(total);
  each_part([&](std::uint32_t& next, std::uint32_t value) { result.values[next++] = value; });
  return result;
}

}  // namespace tetpbd
