// Narrow phase: which of its candidates each item is in, and how many contacts share each vertex. A record has an
// invocation per candidate. LAGGED: they also add up corrections, by the counts that the substep before predicted, for
// vertex.glsl to apply; else push.comp applies them by exact counts.
#include "contact/bodies/pairs.glsl"
layout(std430) restrict readonly buffer Positions { Position positions[]; };
layout(std430) restrict readonly buffer Velocities { Velocity velocities[]; };
#include "contact/bodies/formulas.glsl"
#include "contact/bodies/meeting.glsl"
#include "contact/bodies/correct.glsl"
uniform bool ahead;         // counts are also predicted for the next substep, which may be LAGGED
uniform uint substep;       // since the broad phase
uniform float closed_most;  // m, by which an item and a candidate may approach in a substep
const float none = 1e30;
shared float ranks[GROUP_SIZE], pushing[GROUP_SIZE], gaps[GROUP_SIZE];  // pushing: ranks of those that can push
shared bool doubts[GROUP_SIZE];
shared float folds[GROUP_SIZE];  // ranks of those that push although another candidate is nearer
shared uint touching, deepest;   // of this work-group, so that fewer atomics queue for the totals
// The contact of each record, for the invocations that take one of its vertices each.
#define RECORDS_HERE (GROUP_SIZE / CANDIDATES)
#define ACTIVE 1u
#define EXPECTED 2u  // likely in the next substep
shared Contact contacts[RECORDS_HERE];
shared uvec4 vertices[RECORDS_HERE];
shared uint states[RECORDS_HERE];
shared vec4 shares[GROUP_SIZE];

// Stores the record's contact, if item s is in target t or will soon be.
void store_contact(uint here, uint s, uint t, Contact m, bool is_active, bool is_expected) {
  if (is_active || is_expected)
    states[here] = (is_active ? ACTIVE : 0u) | (is_expected ? EXPECTED : 0u), contacts[here] = m,
    vertices[here] = contact_vertices(s, t & TARGET);
  if (!is_active) return;
  depths[s] = -m.gap;
  atomicAdd(touching, 1u);
  atomicMax(deepest, floatBitsToUint(-m.gap));
#if !LAGGED && EDGES
  uvec4 beside = vertices_beside(s, t & TARGET);
  if (item_is_edge(s))
    for (uint j = 0u; j < 4u; ++j) atomicAdd(contact_sums[beside[j]].readers, 1);
#endif
}
// Finds the candidate that decides whether the item is in a body.
void find_contact(uint here) {
  uint own_lane = gl_LocalInvocationIndex, first = here * CANDIDATES, record = group_index() * RECORDS_HERE + here;
  bool there = record < counts.records && records[record].next <= substep;
  uint s = there ? records[record].item : 0u, t = there ? records[record].candidates[own_lane - first] : NONE;
  Contact m;
  m.gap = m.rank = none;
  m.in_doubt = false;
  if (t != NONE) m = contact_between(s, t);
  bool may_push = t != NONE && (t & BESIDE) == 0u && (m.gap < 0.0 || !item_is_edge(s));
  gaps[own_lane] = m.gap, ranks[own_lane] = m.rank, pushing[own_lane] = may_push ? m.rank : none,
  doubts[own_lane] = m.in_doubt;
  if (own_lane == 0u) touching = deepest = 0u;
  if (own_lane == first) states[here] = 0u;
  barrier();
  uint nearest = first, least = first, behind = first;
  float apart = none;  // m, from the nearest candidate; 0 in any of them
  for (uint c = first; c < first + CANDIDATES; ++c) {
    if (ranks[c] < ranks[nearest]) nearest = c;
    if (pushing[c] < pushing[least]) least = c;
    apart = min(apart, max(gaps[c], 0.0));
  }
  // Where bodies fold or bend inwards, the nearest triangle may say that the vertex is outside, but a tet around it
  // proves that it is inside.
  bool vetoed = gaps[nearest] > 0.0 && there && !item_is_edge(s);
  bool appeals = vetoed && may_push && (m.gap < 0.0 || (m.in_doubt && doubts[nearest]));
  folds[own_lane] = appeals && is_behind(s, t & TARGET) ? m.rank : none;
  barrier();
  for (uint c = first; c < first + CANDIDATES; ++c)
    if (folds[c] < folds[behind]) behind = c;
  bool in_fold = folds[behind] < none;
  if (in_fold) least = behind;
  if (in_fold && m.gap > 0.0) m = turn_inside(m), t |= INSIDE;
  bool decides = there && own_lane == least;
  bool pushes = decides && may_push && m.gap < 0.0 && (!vetoed || in_fold);
  if (decides) records[record].target = held_by[s] = pushes ? t : NONE;
  if (decides && !pushes && !item_is_edge(s)) records[record].next = substep + uint(min(apart / closed_most, 1e6));
  store_contact(here, s, t, m, pushes, ahead && decides && may_push && m.gap >= 0.0 && m.gap < 2.0 * closed_most);
}
void main() {
  uint own_lane = gl_LocalInvocationIndex, here = own_lane / CANDIDATES, first = here * CANDIDATES,
       lane = own_lane - first;
  find_contact(here);
  barrier();
  bool has_vertex = lane < 4u && states[here] != 0u;
  Contact m;
  uint vertex = 0u;
  float weight = 0.0;
  if (has_vertex) {
    m = contacts[here];
    vertex = vertices[here][lane];
    weight = m.weights[lane];
    shares[own_lane] = vertex_share(vertex, weight);
  }
  barrier();
  if (has_vertex) {
    bool is_active = (states[here] & ACTIVE) != 0u;
    vec4 sum = shares[first] + shares[first + 1u] + shares[first + 2u] + shares[first + 3u];
    if (ahead && weight != 0.0 && (is_active || m.gap + 2.0 * dot(sum.xyz, m.normal) < 0.0))
      atomicAdd(sharing[shared_at(vertex, 1u - side)], 1);
#if LAGGED
    if (is_active)
      correct(vertex, weight, contact_correction(m, sum.xyz, push_most, friction_between(vertices[here])), sum);
#else
    if (is_active && weight != 0.0) atomicAdd(sharing[shared_at(vertex, side)], 1);
    if (is_active) atomicAdd(contact_sums[vertex].readers, 1);
#endif
  }
  barrier();
  if (own_lane == 0u && touching > 0u) {
    atomicAdd(totals.touching, touching);
    atomicMax(totals.deepest, deepest);
  }
}
