/* See srs_changes.h. */
#include "srs_changes.h"

static int16_t between(int16_t a, int16_t b, int32_t weight) {
  const int32_t value = 1024 * (int32_t)a + ((int32_t)b - a) * weight;
  return (int16_t)((value + ((value >= 0) ? 512 : -512)) / 1024);
}

static uint8_t is_still(const srs_move *m) {
  return (uint8_t)((m->dx_100um == 0) && (m->dy_100um == 0) && (m->turn_mrad == 0) && (m->speed_mm_s == 0));
}

uint8_t srs_after(const srs_changes *c, uint16_t before, uint16_t now, int16_t speed_mm_s, srs_move *move) {
  const uint16_t row = (before == SRS_NONE) ? c->gait_count : before;
  if ((row > c->gait_count) || (now >= c->gait_count)) { return 0u; }
  const srs_before *from = &c->befores[row];
  const srs_move *moves = c->moves[(uint32_t)row * c->gait_count + now];
  if (is_still(&moves[0]) && is_still(&moves[1]) && is_still(&moves[2])) { return 0u; }
  const uint8_t low = (uint8_t)((speed_mm_s > from->speed_mm_s[1]) ? 1u : 0u);
  const int32_t step = (int32_t)from->speed_mm_s[low + 1u] - from->speed_mm_s[low];
  int32_t weight = 1024 * ((int32_t)speed_mm_s - from->speed_mm_s[low]) / ((step > 0) ? step : 1);
  weight = (weight < -512) ? -512 : ((weight > 1536) ? 1536 : weight);
  const srs_move *a = &moves[low], *b = &moves[low + 1u];
  move->dx_100um = between(a->dx_100um, b->dx_100um, weight);
  move->dy_100um = between(a->dy_100um, b->dy_100um, weight);
  move->turn_mrad = between(a->turn_mrad, b->turn_mrad, weight);
  move->speed_mm_s = between(a->speed_mm_s, b->speed_mm_s, weight);
  return 1u;
}

/* Square root, rounded down. */
static uint32_t root(uint32_t square) {
  uint32_t low = 0, high = 65535;
  while (low < high) {
    const uint32_t middle = (low + high + 1u) / 2u;
    if (middle * middle <= square) {
      low = middle;
    } else {
      high = middle - 1u;
    }
  }
  return low;
}

static int64_t squared(int64_t v) { return v * v; }

uint16_t srs_nearest_after(const srs_program *program, const srs_changes *c, uint16_t before, int16_t begun_mm_s,
                           int16_t speed_mm_s, int16_t turn_rate_mrad_s) {
  uint16_t best = SRS_NONE;
  int64_t least = INT64_MAX;
  const uint16_t row = (before == SRS_NONE) ? c->gait_count : before;
  if ((c->id != program->id) || (row > c->gait_count)) { return SRS_NONE; }
  for (uint16_t k = 0; (k < program->gait_count) && ((speed_mm_s != 0) || (turn_rate_mrad_s != 0)); ++k) {
    srs_gait gait;
    srs_move move;
    srs_read(&gait, &program->gaits[k], (uint16_t)sizeof gait);
    const int64_t far = srs_distance(&gait, speed_mm_s, turn_rate_mrad_s);
    if ((far > SRS_NEAR) || !srs_after(c, before, k, begun_mm_s, &move)) { continue; }
    /* the mean heading swings within a cycle, and each gait at its own phase: the path's turn counts */
    const int32_t turn = (int32_t)move.turn_mrad + c->befores[k].course_mrad - c->befores[row].course_mrad;
    const uint32_t x = (uint32_t)((move.dx_100um < 0) ? -move.dx_100um : move.dx_100um);
    const uint32_t y = (uint32_t)((move.dy_100um < 0) ? -move.dy_100um : move.dy_100um);
    const int64_t way = (move.dx_100um < 0) ? -(int64_t)root(x * x + y * y) : (int64_t)root(x * x + y * y);
    const int64_t period_us = (int64_t)gait.period_ticks * program->tick_us;
    const int64_t miss = squared(1000000 * way / period_us - 10 * (int64_t)speed_mm_s) +
                         squared(1000000 * (int64_t)turn / period_us - turn_rate_mrad_s) + 4 * far;
    if (miss < least) {
      least = miss;
      best = k;
    }
  }
  return best;
}
