/* Plays a gait table as a microcontroller would: one call per tick, valves written only when they change.
 *
 *   cc -std=c99 -Wall -Werror -I FOLDER player.c -o player     (FOLDER holds gait_table.h)
 *   ./player SPEED_MM_S TURN_RATE_MRAD_S TICKS                  prints the valves at every tick
 *
 * On a real controller, write_valves() sets output pins and the loop body is the timer's interrupt. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gait_table.h"

typedef struct {
  const srs_gait *gait; /* null: vented */
  uint32_t tick;        /* since the gait's cycle began */
  uint32_t valves[SRS_WORDS];
} player;

static void start(player *p, const srs_gait *gait) {
  p->gait = gait;
  p->tick = 0;
}

static void stop(player *p) { start(p, NULL); }

/* Both valves of one segment open would short the supply to the air: refuse whatever the table says. */
static int safe(const uint32_t *valves) {
  for (uint32_t w = 0; w < SRS_WORDS; ++w)
    if (valves[w] & (valves[w] >> 1) & 0x55555555u) return 0;
  return 1;
}

static void write_valves(const uint32_t *valves) {
  for (uint32_t s = 0; s < SRS_SEGMENTS; ++s) {
    uint32_t bits = (valves[2 * s / 32] >> (2 * s % 32)) & 3u;
    putchar(bits == 1u ? 'L' : bits == 2u ? 'R' : '-');
  }
  putchar('\n');
}

static void step(player *p) {
  const uint32_t *wanted = srs_valves(p->gait, p->tick);
  memcpy(p->valves, safe(wanted) ? wanted : srs_vent, sizeof p->valves);
  p->tick = p->gait ? (p->tick + 1) % p->gait->period_ticks : 0;
}

int main(int count, char **word) {
  if (count != 4) {
    fprintf(stderr, "usage: %s SPEED_MM_S TURN_RATE_MRAD_S TICKS\n", word[0]);
    return 2;
  }
  player p = {0};
  start(&p, srs_nearest(atoi(word[1]), atoi(word[2])));
  fprintf(stderr, "%s\n", p.gait ? p.gait->name : "vented");
  for (long tick = 0; tick < atol(word[3]); ++tick) {
    step(&p);
    write_valves(p.valves);
  }
  stop(&p);
  step(&p); /* vent at the end */
  write_valves(p.valves);
  return 0;
}
