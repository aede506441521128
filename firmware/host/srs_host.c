/* The firmware as a shared library of the host, for tests and for the virtual robot:
 *   cc -std=c99 -shared -fPIC -I firmware -DSRS_WORDS=1 -DSRS_PROGRAM='"program.h"' \
 *      firmware/srs_player.c firmware/srs_link.c firmware/host/srs_host.c -o libsrs_host.so */
#include <stdlib.h>

#include "srs_link.h"
#include SRS_PROGRAM

srs_device *srs_host_new(void) {
  srs_device *d = malloc(sizeof *d);
  if (d != NULL) { (void)srs_device_init(d, &srs_program_data); }
  return d;
}

void srs_host_free(srs_device *d) { free(d); }

void srs_host_receive(srs_device *d, const uint8_t *bytes, uint32_t count) {
  for (uint32_t k = 0; k < count; ++k) { srs_device_receive(d, bytes[k]); }
}

uint32_t srs_host_send(srs_device *d, uint8_t *bytes, uint32_t most) {
  uint32_t count = 0;
  int16_t byte = 0;
  while ((count < most) && ((byte = srs_device_send(d)) >= 0)) { bytes[count++] = (uint8_t)byte; }
  return count;
}

/* One tick; the state of every segment's valves afterwards, and the regulator's set point. */
uint32_t srs_host_tick(srs_device *d, int8_t *states) {
  srs_device_tick(d);
  for (uint8_t s = 0; s < srs_program_data.segments; ++s) { states[s] = srs_valve(d->player.valves, s); }
  return d->player.pressure_pa;
}

/* Overwrite what is to be played next, as a fault in memory would. */
void srs_host_corrupt(srs_device *d, uint32_t mask) { d->player.wanted[0] = mask; }

uint8_t srs_host_fault(const srs_device *d) { return (uint8_t)d->player.fault; }
uint32_t srs_host_segments(void) { return srs_program_data.segments; }
