#include "shim.h"

#include <math.h>
#include <string.h>

_Static_assert(offsetof(EmQuery, context) == 0, "callbacks cast the context back to the query");
_Static_assert(RTC_INVALID_GEOMETRY_ID == 0xffffffffu, "Rust's INVALID_ID");

#if RTC_VERSION_MAJOR >= 4

void em_query_init(EmQuery* query, unsigned int coherent, void* user) {
  rtcInitRayQueryContext(&query->context);
  query->user = user;
  query->coherent = coherent;
}

#define ARGUMENTS(Kind, query)                                                                  \
  struct RTC##Kind##Arguments args;                                                             \
  rtcInit##Kind##Arguments(&args);                                                              \
  args.flags = (query)->coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT; \
  args.context = &(query)->context

void em_intersect1(RTCScene scene, EmQuery* query, struct RTCRayHit* rayhit) {
  ARGUMENTS(Intersect, query);
  rtcIntersect1(scene, rayhit, &args);
}

void em_occluded1(RTCScene scene, EmQuery* query, struct RTCRay* ray) {
  ARGUMENTS(Occluded, query);
  rtcOccluded1(scene, ray, &args);
}

#define PACKET(N)                                                                                         \
  void em_intersect##N(const int* valid, RTCScene scene, EmQuery* query, struct RTCRayHit##N* rayhit) {   \
    ARGUMENTS(Intersect, query);                                                                          \
    rtcIntersect##N(valid, scene, rayhit, &args);                                                         \
  }                                                                                                       \
  void em_occluded##N(const int* valid, RTCScene scene, EmQuery* query, struct RTCRay##N* ray) {          \
    ARGUMENTS(Occluded, query);                                                                           \
    rtcOccluded##N(valid, scene, ray, &args);                                                             \
  }

void em_intersect_stream1(RTCScene scene, EmQuery* query, struct RTCRayHit* rayhits, unsigned int count) {
  unsigned int i;
  for (i = 0; i < count; ++i)
    if (rayhits[i].ray.tnear <= rayhits[i].ray.tfar) em_intersect1(scene, query, &rayhits[i]);
}

void em_occluded_stream1(RTCScene scene, EmQuery* query, struct RTCRay* rays, unsigned int count) {
  unsigned int i;
  for (i = 0; i < count; ++i)
    if (rays[i].tnear <= rays[i].tfar) em_occluded1(scene, query, &rays[i]);
}

static void switched_on(const struct RTCRay16* ray, int* valid) {
  unsigned int k;
  for (k = 0; k < 16; ++k) valid[k] = ray->tnear[k] <= ray->tfar[k] ? -1 : 0;
}

void em_intersect_stream16(RTCScene scene, EmQuery* query, struct RTCRayHit16* rayhits, unsigned int count) {
  RTC_ALIGN(64) int valid[16];
  unsigned int i;
  for (i = 0; i < count; ++i) {
    switched_on(&rayhits[i].ray, valid);
    em_intersect16(valid, scene, query, &rayhits[i]);
  }
}

void em_occluded_stream16(RTCScene scene, EmQuery* query, struct RTCRay16* rays, unsigned int count) {
  RTC_ALIGN(64) int valid[16];
  unsigned int i;
  for (i = 0; i < count; ++i) {
    switched_on(&rays[i], valid);
    em_occluded16(valid, scene, query, &rays[i]);
  }
}

/* `n` <= 16 words; a constant size lets the compiler move whole packets without a call. */
static inline void copy(void* to, const void* from, unsigned int n) {
  if (n == 16)
    memcpy(to, from, 16 * sizeof(float));
  else
    memcpy(to, from, n * sizeof(float));
}

/* Rays first .. first + n (n <= 16) into a packet; lanes without a ray, or with one that is off, are off. */
static void load_packet(const EmRays* from, unsigned int first, unsigned int n, struct RTCRay16* to, int* valid) {
  unsigned int k;
  copy(to->org_x, from->org_x + first, n);
  copy(to->org_y, from->org_y + first, n);
  copy(to->org_z, from->org_z + first, n);
  copy(to->tnear, from->tnear + first, n);
  copy(to->dir_x, from->dir_x + first, n);
  copy(to->dir_y, from->dir_y + first, n);
  copy(to->dir_z, from->dir_z + first, n);
  copy(to->tfar, from->tfar + first, n);
  if (from->id) copy(to->id, from->id + first, n);
  for (k = 0; k < 16; ++k) {
    to->time[k] = 0.0f;
    to->mask[k] = 0xffffffffu;
    to->flags[k] = 0;
  }
  for (k = 0; k < n; ++k) valid[k] = to->tnear[k] <= to->tfar[k] ? -1 : 0;
  for (k = n; k < 16; ++k) valid[k] = 0;
}

void em_intersect_soa(RTCScene scene, EmQuery* query, const EmRays* rays, const EmHits* hits, unsigned int count) {
  RTC_ALIGN(64) int valid[16];
  struct RTCRayHit16 packet;
  unsigned int first, k;
  for (first = 0; first < count; first += 16) {
    const unsigned int n = count - first < 16 ? count - first : 16;
    load_packet(rays, first, n, &packet.ray, valid);
    for (k = 0; k < 16; ++k)
      packet.hit.primID[k] = packet.hit.geomID[k] = packet.hit.instID[0][k] = RTC_INVALID_GEOMETRY_ID;
    em_intersect16(valid, scene, query, &packet);
    for (k = 0; k < n; ++k)
      if (packet.hit.geomID[k] != RTC_INVALID_GEOMETRY_ID) break;
    if (k == n) continue;
    copy(rays->tfar + first, packet.ray.tfar, n);
    copy(hits->u + first, packet.hit.u, n);
    copy(hits->v + first, packet.hit.v, n);
    copy(hits->primID + first, packet.hit.primID, n);
    copy(hits->geomID + first, packet.hit.geomID, n);
    copy(hits->instID + first, packet.hit.instID[0], n);
  }
}

void em_occluded_soa(RTCScene scene, EmQuery* query, const EmRays* rays, unsigned int count) {
  RTC_ALIGN(64) int valid[16];
  struct RTCRay16 packet;
  unsigned int first;
  for (first = 0; first < count; first += 16) {
    const unsigned int n = count - first < 16 ? count - first : 16;
    load_packet(rays, first, n, &packet, valid);
    em_occluded16(valid, scene, query, &packet);
    copy(rays->tfar + first, packet.tfar, n);
  }
}

#else /* Embree 3 */

void em_query_init(EmQuery* query, unsigned int coherent, void* user) {
  rtcInitIntersectContext(&query->context);
  query->context.flags =
      coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
  query->user = user;
  query->coherent = coherent;
}

void em_intersect1(RTCScene scene, EmQuery* query, struct RTCRayHit* rayhit) {
  rtcIntersect1(scene, &query->context, rayhit);
}

void em_occluded1(RTCScene scene, EmQuery* query, struct RTCRay* ray) {
  rtcOccluded1(scene, &query->context, ray);
}

/* A packet of a width that is not native to the CPU (16 without AVX-512, 8 without AVX; every width in a build without
 * packets) goes through Embree 3's stream filter, whatever the flags, and that never looks at `valid`: measured on
 * 3.13.5, its lanes that are off come back hit. The filter leaves out rays whose segment is empty, so lanes that are
 * off get an empty one for the time of the call. Returns whether there are any. */
static inline bool empty_segments(const int* valid, float* tfar, float* kept, unsigned int n) {
  unsigned int k;
  int all = -1;
  for (k = 0; k < n; ++k) all &= valid[k];
  if (all) return false;
  for (k = 0; k < n; ++k) {
    kept[k] = tfar[k];
    if (!valid[k]) tfar[k] = -INFINITY; /* below any tnear, also one that is infinite itself */
  }
  return true;
}

static inline void restore_segments(const int* valid, float* tfar, const float* kept, unsigned int n) {
  unsigned int k;
  for (k = 0; k < n; ++k)
    if (!valid[k]) tfar[k] = kept[k];
}

#define PACKET(N)                                                                                         \
  void em_intersect##N(const int* valid, RTCScene scene, EmQuery* query, struct RTCRayHit##N* rayhit) {   \
    float kept[N];                                                                                        \
    const bool off = empty_segments(valid, rayhit->ray.tfar, kept, N);                                    \
    rtcIntersect##N(valid, scene, &query->context, rayhit);                                               \
    if (off) restore_segments(valid, rayhit->ray.tfar, kept, N);                                          \
  }                                                                                                       \
  void em_occluded##N(const int* valid, RTCScene scene, EmQuery* query, struct RTCRay##N* ray) {          \
    float kept[N];                                                                                        \
    const bool off = empty_segments(valid, ray->tfar, kept, N);                                           \
    rtcOccluded##N(valid, scene, &query->context, ray);                                                   \
    if (off) restore_segments(valid, ray->tfar, kept, N);                                                 \
  }

void em_intersect_stream1(RTCScene scene, EmQuery* query, struct RTCRayHit* rayhits, unsigned int count) {
  rtcIntersect1M(scene, &query->context, rayhits, count, sizeof(struct RTCRayHit));
}

void em_occluded_stream1(RTCScene scene, EmQuery* query, struct RTCRay* rays, unsigned int count) {
  rtcOccluded1M(scene, &query->context, rays, count, sizeof(struct RTCRay));
}

void em_intersect_stream16(RTCScene scene, EmQuery* query, struct RTCRayHit16* rayhits, unsigned int count) {
  rtcIntersectNM(scene, &query->context, (struct RTCRayHitN*)rayhits, 16, count, sizeof(struct RTCRayHit16));
}

void em_occluded_stream16(RTCScene scene, EmQuery* query, struct RTCRay16* rays, unsigned int count) {
  rtcOccludedNM(scene, &query->context, (struct RTCRayN*)rays, 16, count, sizeof(struct RTCRay16));
}

/* Embree reads the fields that are const here, although its own type says otherwise; fields left null are not
 * wanted or have their default. */
static struct RTCRayNp as_embree(const EmRays* rays) {
  struct RTCRayNp to;
  memset(&to, 0, sizeof to);
  to.org_x = (float*)rays->org_x;
  to.org_y = (float*)rays->org_y;
  to.org_z = (float*)rays->org_z;
  to.tnear = (float*)rays->tnear;
  to.dir_x = (float*)rays->dir_x;
  to.dir_y = (float*)rays->dir_y;
  to.dir_z = (float*)rays->dir_z;
  to.id = (unsigned int*)rays->id;
  to.tfar = rays->tfar;
  return to;
}

void em_intersect_soa(RTCScene scene, EmQuery* query, const EmRays* rays, const EmHits* hits, unsigned int count) {
  struct RTCRayHitNp rayhits;
  memset(&rayhits.hit, 0, sizeof rayhits.hit);
  rayhits.ray = as_embree(rays);
  rayhits.hit.u = hits->u;
  rayhits.hit.v = hits->v;
  rayhits.hit.primID = hits->primID;
  rayhits.hit.geomID = hits->geomID;
  rayhits.hit.instID[0] = hits->instID;
  rtcIntersectNp(scene, &query->context, &rayhits, count);
}

void em_occluded_soa(RTCScene scene, EmQuery* query, const EmRays* rays, unsigned int count) {
  const struct RTCRayNp np = as_embree(rays);
  rtcOccludedNp(scene, &query->context, &np, count);
}

#endif

PACKET(4)
PACKET(8)
PACKET(16)
