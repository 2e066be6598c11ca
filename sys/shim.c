#include "shim.h"

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

#define PACKET(N)                                                                                         \
  void em_intersect##N(const int* valid, RTCScene scene, EmQuery* query, struct RTCRayHit##N* rayhit) {   \
    rtcIntersect##N(valid, scene, &query->context, rayhit);                                               \
  }                                                                                                       \
  void em_occluded##N(const int* valid, RTCScene scene, EmQuery* query, struct RTCRay##N* ray) {          \
    rtcOccluded##N(valid, scene, &query->context, ray);                                                   \
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

#endif

PACKET(4)
PACKET(8)
PACKET(16)
