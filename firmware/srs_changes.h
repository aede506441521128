/* What a cycle of a gait does after a cycle of another, by lookup: for controllers that choose gaits themselves or
 * reckon where the robot is. The table, gait_changes.h, takes 24 bytes per pair of gaits (890 kB for 192 gaits):
 * it needs a 32-bit controller, and is only linked where it is included. */
#ifndef SRS_CHANGES_H
#define SRS_CHANGES_H
#include "srs_player.h"

/* One cycle, in the frame of the pose (centre of mass, mean heading) at its start. */
typedef struct {
  int16_t dx_100um;
  int16_t dy_100um;
  int16_t turn_mrad;
  int16_t speed_mm_s; /* forward speed at the cycle's end: begin the next cycle with it */
} srs_move;

/* The gait before. */
typedef struct {
  int16_t speed_mm_s[3]; /* forward speeds at a cycle's begin for which moves are known, ascending */
  int16_t course_mrad;   /* from the mean heading to the direction of travel, where its cycle ends */
} srs_before;

typedef struct {
  uint32_t id; /* of the program whose gaits it is about */
  uint16_t gait_count;
  const srs_before *befores; /* one per gait, then rest */
  const srs_move (*moves)[3]; /* gait_count per gait before, of three speeds each; all 0: cannot follow */
} srs_changes;

/* What a cycle of `now` does after one of `before` (SRS_NONE: from rest), begun at a forward speed; returns 0 if it
 * cannot follow, or there is no such gait. */
uint8_t srs_after(const srs_changes *c, uint16_t before, uint16_t now, int16_t speed_mm_s, srs_move *move);

/* Of the gaits that are near a wanted motion (see srs_nearest) the one that comes nearest to it in its next cycle
 * and, counting twice, in its steady motion; `begun_mm_s` is the forward speed now. SRS_NONE, which is to vent, where there is none. */
uint16_t srs_nearest_after(const srs_program *program, const srs_changes *c, uint16_t before, int16_t begun_mm_s,
                           int16_t speed_mm_s, int16_t turn_rate_mrad_s);
#endif
