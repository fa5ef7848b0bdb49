// Which of its candidates each item is in, and how many contacts share every vertex. CANDIDATES invocations per record,
// one for each candidate. LAGGED: the corrections as well, by how many contacts the substep before saw coming;
// vertex.glsl adds them. Else push.comp does so by exact numbers.
#include "contact/bodies/pairs.glsl"
layout(std430) restrict readonly buffer Positions { Position positions[]; };
layout(std430) restrict readonly buffer Velocities { Velocity velocities[]; };
#include "contact/bodies/formulas.glsl"
#include "contact/bodies/meeting.glsl"
#include "contact/bodies/correct.glsl"
uniform bool ahead;         // the next substep may be LAGGED
uniform uint substep;       // since candidates were looked for
uniform float closed_most;  // m, by which an item and a candidate may come nearer in a substep
const float none = 1e30;
shared float ranks[GROUP_SIZE], pushing[GROUP_SIZE], gaps[GROUP_SIZE];  // pushing: ranks of those that may
shared bool doubts[GROUP_SIZE];
shared float folds[GROUP_SIZE];  // ranks of those that push in spite of a nearer one
shared uint touching, deepest;  // of this work-group, so that not all contacts queue for two numbers
// Item s is in target t, or may be before long: what the invocations of its record need for its vertices, one each.
#define RECORDS_HERE (GROUP_SIZE / CANDIDATES)
#define TOUCHES 1u
#define COMES 2u
shared Meeting meetings[RECORDS_HERE];
shared uvec4 vertices_met[RECORDS_HERE];
shared uint what_happens[RECORDS_HERE];
shared vec4 parts[GROUP_SIZE];
void main() {
  uint own_lane = gl_LocalInvocationIndex, here = own_lane / CANDIDATES, first = here * CANDIDATES,
       lane = own_lane - first;
  uint record = group_index() * RECORDS_HERE + here;
  bool there = record < counts.records && records[record].next <= substep;
  uint s = there ? records[record].item : 0u, t = there ? records[record].candidates[lane] : NONE;
  Meeting m;
  m.gap = m.rank = none;
  m.in_doubt = false;
  if (t != NONE) m = meeting_of(s, t);
  bool may_push = t != NONE && (t & BESIDE) == 0u && (m.gap < 0.0 || !item_is_edge(s));
  gaps[own_lane] = m.gap, ranks[own_lane] = m.rank, pushing[own_lane] = may_push ? m.rank : none,
  doubts[own_lane] = m.in_doubt;
  if (own_lane == 0u) touching = deepest = 0u;
  if (lane == 0u) what_happens[here] = 0u;
  barrier();
  uint nearest = first, least = first, behind = first;
  float apart = none;  // m, from the nearest; of one that is in any, 0
  for (uint c = first; c < first + CANDIDATES; ++c) {
    if (ranks[c] < ranks[nearest]) nearest = c;
    if (pushing[c] < pushing[least]) least = c;
    apart = min(apart, max(gaps[c], 0.0));
  }
  // Where bodies fold or are bent inwards the nearest triangle may say that the vertex is outside, but a tet that it is
  // in does not err.
  bool vetoed = gaps[nearest] > 0.0 && there && !item_is_edge(s);
  bool asks = vetoed && may_push && (m.gap < 0.0 || (m.in_doubt && doubts[nearest]));
  folds[own_lane] = asks && is_behind(s, t & TARGET) ? m.rank : none;
  barrier();
  for (uint c = first; c < first + CANDIDATES; ++c)
    if (folds[c] < folds[behind]) behind = c;
  bool in_fold = folds[behind] < none;
  if (in_fold) least = behind;
  if (in_fold && m.gap > 0.0) m = inside(m), t |= INSIDE;
  bool decides = there && own_lane == least;
  bool pushes = decides && may_push && m.gap < 0.0 && (!vetoed || in_fold);
  if (decides) records[record].target = held_by[s] = pushes ? t : NONE;
  if (decides && !pushes && !item_is_edge(s)) records[record].next = substep + uint(min(apart / closed_most, 1e6));
  bool comes = ahead && decides && may_push && m.gap >= 0.0 && m.gap < 2.0 * closed_most;
  if (pushes || comes)
    what_happens[here] = (pushes ? TOUCHES : 0u) | (comes ? COMES : 0u), meetings[here] = m,
    vertices_met[here] = vertices_of(s, t & TARGET);
  if (pushes) {
    depths[s] = -m.gap;
    atomicAdd(touching, 1u);
    atomicMax(deepest, floatBitsToUint(-m.gap));
#if !LAGGED && EDGES
    uvec4 beside = beside_of(s, t & TARGET);
    if (item_is_edge(s))
      for (uint j = 0u; j < 4u; ++j) atomicAdd(contact_sums[beside[j]].asks, 1);
#endif
  }
  barrier();
  bool serves = lane < 4u && what_happens[here] != 0u;
  uint vertex = 0u;
  float weight = 0.0;
  if (serves) {
    m = meetings[here];
    vertex = vertices_met[here][lane];
    weight = m.weights[lane];
    parts[own_lane] = part_of(vertex, weight);
  }
  barrier();
  if (serves) {
    bool touches = (what_happens[here] & TOUCHES) != 0u;
    vec4 sum = parts[first] + parts[first + 1u] + parts[first + 2u] + parts[first + 3u];
    // In this substep, in the next or after it.
    if (ahead && weight != 0.0 && (touches || m.gap + 2.0 * dot(sum.xyz, m.normal) < 0.0))
      atomicAdd(sharing[shared_at(vertex, 1u - side)], 1);
#if LAGGED
    if (touches)
      correct(vertex, weight, meeting_correction(m, sum.xyz, push_most, friction_between(vertices_met[here])), sum);
#else
    if (touches && weight != 0.0) atomicAdd(sharing[shared_at(vertex, side)], 1);
    if (touches) atomicAdd(contact_sums[vertex].asks, 1);
#endif
  }
  barrier();
  if (own_lane == 0u && touching > 0u) {
    atomicAdd(totals.touching, touching);
    atomicMax(totals.deepest, deepest);
  }
}
