// Loops over independent items on several cores (OpenMP). Results never depend on the number of cores.
#pragma once

#include <omp.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <numeric>
#include <span>
#include <vector>

namespace tetpbd {

/// Calls f(first, end) for consecutive parts of 0 .. count, one for each thread, of at least `least` items each. What f
/// writes must depend on the item alone. Rethrows what the first part that failed threw.
template <class F>
void parallel_parts(std::size_t count, std::size_t least, F&& f) {
  const int threads = std::clamp(omp_get_max_threads(), 1, 16);  // beyond 16, memory is the limit
  const std::size_t parts = std::clamp<std::size_t>(count / least, 1, std::size_t(threads));
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

/// Calls f(item) for 0 .. count, with at least `least` items to a thread.
template <class F>
void parallel_for(std::size_t count, std::size_t least, F&& f) {
  parallel_parts(count, least, [&](std::size_t first, std::size_t end) {
    for (std::size_t i = first; i < end; ++i) f(i);
  });
}
template <class F>
void parallel_for(std::size_t count, F&& f, std::size_t least = 8192) {
  parallel_for(count, least, std::forward<F>(f));
}

/// Sorts items, of which no two may be equal. __gnu_parallel::sort would end the program where a comparison throws or
/// memory runs out.
template <class T>
void parallel_sort(std::span<T> items) {
  const std::size_t threads = std::size_t(std::max(omp_get_max_threads(), 1)), count = items.size();
  std::size_t run = std::max<std::size_t>((count + threads - 1) / threads, 8192);
  const auto at = [&](std::size_t i) { return items.begin() + std::ptrdiff_t(std::min(i, count)); };
  parallel_for((count + run - 1) / run, 1, [&](std::size_t k) { std::sort(at(k * run), at((k + 1) * run)); });
  for (; run < count; run *= 2)
    parallel_for((count + 2 * run - 1) / (2 * run), 1, [&](std::size_t k) {
      std::inplace_merge(at(2 * k * run), at((2 * k + 1) * run), at(2 * (k + 1) * run));
    });
}

/// The values of key k are values[first[k]] up to values[first[k + 1]], in the order of their items.
struct Grouped {
  std::vector<std::uint32_t> first, values;
};
/// Counting sort. each(item, emit) calls emit(key, value), the same both times that it is called for an item; there are
/// fewer than 2^32 values in all.
template <class Each>
Grouped group_by_key(std::size_t items, std::size_t keys, Each&& each) {
  Grouped result{std::vector<std::uint32_t>(keys + 1, 0), {}};
  for (std::size_t i = 0; i < items; ++i) each(i, [&](std::uint32_t key, std::uint32_t) { ++result.first[key + 1]; });
  std::partial_sum(result.first.begin(), result.first.end(), result.first.begin());
  result.values.resize(result.first.back());
  std::vector<std::uint32_t> next = result.first;
  for (std::size_t i = 0; i < items; ++i)
    each(i, [&](std::uint32_t key, std::uint32_t value) { result.values[next[key]++] = value; });
  return result;
}

}  // namespace tetpbd
