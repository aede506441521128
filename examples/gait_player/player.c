/* Plays a gait table on the firmware's player library as a microcontroller would: one call per tick.
 *
 *   cc -std=c99 -I FOLDER -I firmware player.c firmware/srs_player.c -o player   (FOLDER holds gait_table.h)
 *   ./player SPEED_MM_S TURN_RATE_MRAD_S TICKS      prints the valves at every tick, from the first cycle on
 *
 * On a real controller the loop body is the timer's interrupt, and srs_write_pins() sets output pins. */
#include <stdio.h>
#include <stdlib.h>

#include "gait_table.h"

static void print_valves(const srs_player *p) {
  for (uint8_t s = 0; s < p->program->segments; ++s) {
    const int8_t state = srs_valve(p->valves, s);
    putchar(state == 1 ? 'L' : state == -1 ? 'R' : '-');
  }
  putchar('\n');
}

int main(int count, char **word) {
  if (count != 4) {
    fprintf(stderr, "usage: %s SPEED_MM_S TURN_RATE_MRAD_S TICKS\n", word[0]);
    return 2;
  }
  static srs_player player;
  if (srs_player_init(&player, &srs_program_data) != SRS_OK) { return 1; }
  const uint16_t gait = srs_nearest(&srs_program_data, (int16_t)atoi(word[1]), (int16_t)atoi(word[2]));
  if (gait == SRS_NONE) {
    fprintf(stderr, "vented: no gait is near\n");
  } else {
    fprintf(stderr, "gait %u\n", (unsigned)gait);
    (void)srs_player_select(&player, gait, gait);
    while (player.state != SRS_PLAYING) { srs_player_tick(&player); } /* the regulator settles */
    print_valves(&player);
  }
  for (long tick = gait == SRS_NONE ? 0 : 1; tick < atol(word[3]); ++tick) {
    player.silent = 0; /* a pilot's word; without it the controller vents after its timeout */
    srs_player_tick(&player);
    print_valves(&player);
  }
  srs_player_vent(&player);
  srs_player_tick(&player);
  print_valves(&player);
  return 0;
}
