// Loops over independent items on several cores. Results never depend on how many.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <span>
#include <system_error>
#include <thread>
#include <vector>

namespace tetpbd {

/// Threads of a loop: the cores this process may use, at most 16 (loading is then bound by memory).
unsigned thread_count();
/// 0: as many as there are cores.
void set_thread_count(unsigned count);

/// Calls f(first, end) for parts of 0 .. count that follow each other, one a thread and `least` items or more
/// each; what f writes must depend on the item alone. Rethrows what the first part that failed threw.
template <class F>
void parallel_for(std::size_t count, F&& f, std::size_t least = 8192) {
  const std::size_t parts = std::min<std::size_t>(thread_count(), count / std::max<std::size_t>(least, 1));
  if (parts < 2) return f(std::size_t(0), count);
  std::vector<std::exception_ptr> failed(parts);
  const auto run = [&](std::size_t part) {
    try {
      f(count * part / parts, count * (part + 1) / parts);
    } catch (...) {
      failed[part] = std::current_exception();
    }
  };
  {
    std::vector<std::jthread> threads;
    threads.reserve(parts);
    for (std::size_t part = 1; part < parts; ++part) try {
        threads.emplace_back(run, part);
      } catch (const std::system_error&) {  // the system gives no more threads
        run(part);
      }
    run(0);
  }
  for (const std::exception_ptr& e : failed)
    if (e) std::rethrow_exception(e);
}

/// Sorts items none of which are equal: parts at once, then pairs of neighbours are merged.
template <class T>
void parallel_sort(std::span<T> items) {
  std::size_t parts = 1;
  while (parts * 2 <= thread_count() && items.size() / (parts * 2) >= 8192) parts *= 2;
  const auto at = [&](std::size_t part) {
    return items.begin() + std::ptrdiff_t(items.size() * part / parts);
  };
  parallel_for(
      parts,
      [&](std::size_t first, std::size_t end) {
        for (std::size_t part = first; part < end; ++part) std::sort(at(part), at(part + 1));
      },
      1);
  for (std::size_t width = 1; width < parts; width *= 2)
    parallel_for(
        parts / (2 * width),
        [&](std::size_t first, std::size_t end) {
          for (std::size_t pair = first; pair < end; ++pair)
            std::inplace_merge(at(2 * width * pair), at(2 * width * pair + width),
                               at(2 * width * (pair + 1)));
        },
        1);
}

/// Values grouped by key: those of key k are values[first[k]] .. values[first[k + 1]], in the order of their
/// items.
struct Grouped {
  std::vector<std::uint32_t> first, values;
};
/// Counting sort. each(item, emit) calls emit(key, value) as often as it likes, the same each time it is
/// asked; fewer than 2^32 values in all.
template <class Each>
Grouped group_by_key(std::size_t items, std::size_t keys, Each&& each) {
  const std::size_t parts = std::max<std::size_t>(1, std::min<std::size_t>(thread_count(), items / 65536));
  std::vector<std::vector<std::uint32_t>> at(parts);  // by part and key: how many, then where the next goes
  const auto each_part = [&](const auto& visit) {
    const auto run = [&](std::size_t begin, std::size_t end) {
      for (std::size_t part = begin; part < end; ++part)
        visit(at[part], items * part / parts, items * (part + 1) / parts);
    };
    parallel_for(parts, run, 1);
  };
  each_part([&](std::vector<std::uint32_t>& counts, std::size_t begin, std::size_t end) {
    counts.assign(keys, 0);
    for (std::size_t i = begin; i < end; ++i)
      each(i, [&](std::uint32_t key, std::uint32_t) { ++counts[key]; });
  });
  Grouped result;
  result.first.resize(keys + 1);
  std::uint32_t total = 0;
  for (std::size_t key = 0; key < keys; ++key) {
    result.first[key] = total;
    for (auto& counts : at) {
      const std::uint32_t count = counts[key];
      counts[key] = total;
      total += count;
    }
  }
  result.first[keys] = total;
  result.values.resize(total);
  each_part([&](std::vector<std::uint32_t>& next, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      each(i, [&](std::uint32_t key, std::uint32_t value) { result.values[next[key]++] = value; });
  });
  return result;
}

}  // namespace tetpbd
