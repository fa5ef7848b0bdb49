// Functions of float that compilers would call from the library one lane at a time, written so that a loop over lanes
// is vectorized.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

namespace tetpbd {

struct LaneMath {
  /// The angle of (x, y), to 3e-7 rad; 0 for (0, 0). Polynomial of Cephes' atanf (Moshier 1989).
  static float atan(float y, float x) {
    const float ax = std::abs(x), ay = std::abs(y);
    const float small = ax < ay ? ax : ay, large = ax < ay ? ay : ax;
    const bool upper = small > 0.414213562f * large;  // above pi/8: as pi/4 and the rest
    const float above = upper ? small - large : small;
    const float below = upper ? small + large : large;
    const float t = above / (below > 0 ? below : 1.0f), z = t * t;
    const float series = ((8.05374449538e-2f * z - 1.38776856032e-1f) * z + 1.99777106478e-1f) * z - 3.33329491539e-1f;
    float angle = (upper ? 0.785398163f : 0.0f) + (series * z * t + t);
    angle = ax < ay ? 1.57079633f - angle : angle;
    angle = x < 0 ? 3.14159265f - angle : angle;
    return y < 0 ? -angle : angle;
  }
  /// x^(2/3) of x >= 0, which is all that formulas ask for, to 5e-7 of itself from 1e-30 on.
  static float pow(float x, float) {
    // A third of the exponent is 5 % off; Halley's iteration for the cube root triples the digits.
    float root = std::bit_cast<float>(std::bit_cast<std::int32_t>(x) / 3 + 709921077);
    for (int i = 0; i < 2; ++i) {
      const float cube = root * root * root;
      root *= (cube + 2 * x) / (2 * cube + x);
    }
    return root * root;
  }
  /// The logarithm of x > 0, to 2e-7 of the larger of 1 and the result. Polynomial of Cephes' logf (Moshier 1989).
  static float log(float x) {
    const std::int32_t bits = std::bit_cast<std::int32_t>(x);
    std::int32_t exponent = (bits >> 23) - 126;
    float m = std::bit_cast<float>((bits & 0x007fffff) | 0x3f000000);  // 0.5 to 1
    const bool lower = m < 0.707106781f;
    exponent -= lower ? 1 : 0;
    m = (lower ? m + m : m) - 1.0f;
    const float z = m * m;
    float p = 7.0376836292e-2f;
    for (const float next : {-1.1514610310e-1f, 1.1676998740e-1f, -1.2420140846e-1f, 1.4249322787e-1f,
                             -1.6668057665e-1f, 2.0000714765e-1f, -2.4999993993e-1f, 3.3333331174e-1f})
      p = p * m + next;
    return m - 0.5f * z + p * m * z + float(exponent) * 0.693147181f;
  }
};

}  // namespace tetpbd
