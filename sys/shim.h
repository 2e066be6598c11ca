/* One face for Embree 3 and Embree 4.
 *
 * What the two versions share (devices, scenes, geometries, buffers, filters, ray and hit layouts) is used as it
 * stands in rtcore.h. What differs is here: how a query is made, what it carries, and streams.
 */
#ifndef EMBREE_SYS_SHIM_H
#define EMBREE_SYS_SHIM_H

#include <stdbool.h>
#include <stddef.h>

/* The build script says which header was found: <embree4/rtcore.h>, <embree3/rtcore.h> or <rtcore.h>. */
#include EM_RTCORE_H

#define EM_MAJOR RTC_VERSION_MAJOR
#define EM_MINOR RTC_VERSION_MINOR
#define EM_PATCH RTC_VERSION_PATCH
#define EM_MAX_INSTANCE_LEVELS RTC_MAX_INSTANCE_LEVEL_COUNT

/* Embree's own per-query context; a callback finds a pointer to it in its arguments. */
#if RTC_VERSION_MAJOR >= 4
typedef struct RTCRayQueryContext EmContext;
#else
typedef struct RTCIntersectContext EmContext;
#endif

/* A query: Embree's context first, so that a callback may cast the context it is given back to the query and
 * reach `user`. It holds no pointer into itself and may be moved. Make one per thread and depth of nesting: a query
 * that is begun inside a callback needs its own, because the context holds the stack of instances. */
typedef struct EmQuery {
  EmContext context;
  void* user;
  unsigned int coherent; /* 0 or 1; a hint for packets and streams */
} EmQuery;

void em_query_init(EmQuery* query, unsigned int coherent, void* user);

void em_intersect1(RTCScene scene, EmQuery* query, struct RTCRayHit* rayhit);
void em_occluded1(RTCScene scene, EmQuery* query, struct RTCRay* ray);

/* Packets: a lane whose `valid` is 0 takes no part and comes back untouched, on any CPU (Embree 3 alone does not keep
 * that promise for widths that the CPU lacks: see shim.c). */
void em_intersect4(const int* valid, RTCScene scene, EmQuery* query, struct RTCRayHit4* rayhit);
void em_intersect8(const int* valid, RTCScene scene, EmQuery* query, struct RTCRayHit8* rayhit);
void em_intersect16(const int* valid, RTCScene scene, EmQuery* query, struct RTCRayHit16* rayhit);
void em_occluded4(const int* valid, RTCScene scene, EmQuery* query, struct RTCRay4* ray);
void em_occluded8(const int* valid, RTCScene scene, EmQuery* query, struct RTCRay8* ray);
void em_occluded16(const int* valid, RTCScene scene, EmQuery* query, struct RTCRay16* ray);

/* Streams: `count` single rays, or `count` packets of 16, one behind the other in memory. Embree 4 has no streams;
 * there the same calls loop over single rays or packets, so that the answer is the same and only the speed differs
 * (EM_HAS_STREAMS says which). A ray with tnear > tfar is off. */
#define EM_HAS_STREAMS (RTC_VERSION_MAJOR == 3)
void em_intersect_stream1(RTCScene scene, EmQuery* query, struct RTCRayHit* rayhits, unsigned int count);
void em_intersect_stream16(RTCScene scene, EmQuery* query, struct RTCRayHit16* rayhits, unsigned int count);
void em_occluded_stream1(RTCScene scene, EmQuery* query, struct RTCRay* rays, unsigned int count);
void em_occluded_stream16(RTCScene scene, EmQuery* query, struct RTCRay16* rays, unsigned int count);

/* Rays in plain arrays, one a field, of any length and alignment; id may be null. tfar becomes the distance of a
 * hit, or -inf where em_occluded_soa finds something. */
typedef struct EmRays {
  const float* org_x;
  const float* org_y;
  const float* org_z;
  const float* tnear;
  const float* dir_x;
  const float* dir_y;
  const float* dir_z;
  const unsigned int* id;
  float* tfar;
} EmRays;

/* Where hits are written, in plain arrays. A miss leaves the ids as they were or sets them to
 * RTC_INVALID_GEOMETRY_ID, so at least one of primID and geomID should hold that before. Normals are not wanted. */
typedef struct EmHits {
  float* u;
  float* v;
  unsigned int* primID;
  unsigned int* geomID;
  unsigned int* instID;
} EmHits;

void em_intersect_soa(RTCScene scene, EmQuery* query, const EmRays* rays, const EmHits* hits, unsigned int count);
void em_occluded_soa(RTCScene scene, EmQuery* query, const EmRays* rays, unsigned int count);

#endif
