/* See srs_link.h. Frames as in RFC 1662: flag 0x7E, escape 0x7D with bit 5 changed, CRC-16/X.25 at the end. */
#include "srs_link.h"

#include <string.h>

static uint16_t checksum(uint16_t crc, uint8_t byte) {
  crc ^= byte;
  for (uint8_t bit = 0; bit < 8u; ++bit) {
    crc = (uint16_t)((crc >> 1) ^ (((crc & 1u) != 0u) ? 0x8408u : 0u));
  }
  return crc;
}

static uint16_t get16(const uint8_t *from) { return (uint16_t)(from[0] | ((uint16_t)from[1] << 8)); }
static uint32_t get32(const uint8_t *from) { return get16(from) | ((uint32_t)get16(from + 2) << 16); }

static uint8_t *put(uint8_t *to, uint32_t value, uint8_t bytes) {
  for (uint8_t k = 0; k < bytes; ++k) { to[k] = (uint8_t)(value >> (8u * k)); }
  return to + bytes;
}

static void push(srs_device *d, uint8_t byte) {
  d->out[(d->out_first + d->out_count) % SRS_SEND_MAX] = byte;
  ++d->out_count;
}

/* Queue a frame whole or, where the line is behind, not at all: a status that is old has no use. */
static void send(srs_device *d, const uint8_t *frame, uint8_t count) {
  uint16_t crc = 0xFFFFu;
  if (d->out_count + 2u * (count + 2u) + 2u > SRS_SEND_MAX) { return; }
  push(d, 0x7Eu);
  for (uint8_t k = 0; k < count + 2u; ++k) {
    const uint8_t byte = (k < count) ? frame[k] : (uint8_t)((uint16_t)~crc >> (8u * (k - count)));
    crc = (k < count) ? checksum(crc, byte) : crc;
    if ((byte == 0x7Eu) || (byte == 0x7Du)) {
      push(d, 0x7Du);
      push(d, byte ^ 0x20u);
    } else {
      push(d, byte);
    }
  }
  push(d, 0x7Eu);
}

static void send_hello(srs_device *d, uint8_t seq) {
  const srs_program *g = d->player.program;
  uint8_t frame[24], *to = frame;
  to = put(put(put(to, SRS_PROTOCOL, 1), SRS_HELLO, 1), seq, 1);
  to = put(put(put(to, g->segments, 1), SRS_WORDS, 1), SRS_MAX_EVENTS, 1);
  to = put(put(put(put(to, g->gait_count, 2), g->step_count, 2), g->tick_us, 4), g->id, 4);
  to = put(to, (uint32_t)d->player.fault, 1);
  send(d, frame, (uint8_t)(to - frame));
}

static void send_status(srs_device *d, uint8_t seq, uint8_t result) {
  const srs_player *p = &d->player;
  const uint16_t pending = (p->has_pending != 0u) ? p->pending.index : SRS_NONE;
  uint8_t frame[40], *to = frame;
  to = put(put(put(put(to, SRS_PROTOCOL, 1), SRS_STATUS, 1), seq, 1), result, 1);
  to = put(put(put(to, (uint32_t)p->state, 1), (uint32_t)p->fault, 1), p->has_pending, 1);
  to = put(put(put(put(to, p->now.index, 2), pending, 2), p->tick, 2), p->now.gait.period_ticks, 2);
  to = put(put(put(put(to, p->step, 2), p->cycles, 4), p->time, 4), p->pressure_pa, 4);
  to = put(to, d->bad_frames, 2);
  send(d, frame, (uint8_t)(to - frame));
}

static uint8_t take_cycle(srs_device *d, const uint8_t *payload, uint16_t bytes) {
  const uint16_t each = (uint16_t)(2u + 4u * SRS_WORDS);
  srs_event events[SRS_MAX_EVENTS];
  if ((bytes < 9u) || (payload[8] > SRS_MAX_EVENTS) || (bytes != 9u + payload[8] * each)) {
    return (uint8_t)SRS_REFUSED_CYCLE;
  }
  for (uint8_t k = 0; k < payload[8]; ++k) {
    const uint8_t *from = payload + 9u + (uint16_t)(k * each);
    events[k].tick = get16(from);
    for (uint8_t w = 0; w < (uint8_t)SRS_WORDS; ++w) { events[k].valves[w] = get32(from + 2u + 4u * w); }
  }
  return (uint8_t)srs_player_cycle(&d->player, get16(payload), get16(payload + 2), get32(payload + 4), events,
                                   payload[8]);
}

static uint8_t carry_out(srs_device *d, uint8_t type, const uint8_t *payload, uint16_t bytes) {
  uint8_t result = (uint8_t)SRS_OK;
  if ((type == SRS_SELECT) && (bytes == 4u)) {
    result = (uint8_t)srs_player_select(&d->player, get16(payload), get16(payload + 2));
  } else if ((type == SRS_CYCLE) && (bytes > 0u)) {
    result = take_cycle(d, payload, bytes);
  } else if ((type == SRS_RUN) && (bytes == 0u)) {
    result = (uint8_t)srs_player_run(&d->player);
  } else if ((type == SRS_VENT) && (bytes == 0u)) {
    srs_player_vent(&d->player);
  } else if ((type != SRS_QUERY) && (type != SRS_PING)) { result = (uint8_t)SRS_REFUSED_MESSAGE; }
  return result;
}

static void take_frame(srs_device *d) {
  uint16_t crc = 0xFFFFu;
  for (uint16_t k = 0; k < d->in_count; ++k) { crc = checksum(crc, d->in[k]); }
  /* over a frame and its own checksum, CRC-16/X.25 leaves 0xF0B8 */
  if ((d->in_count < 5u) || (crc != 0xF0B8u) || (d->in[0] != SRS_PROTOCOL)) {
    ++d->bad_frames;
    return;
  }
  const uint8_t type = d->in[1], seq = d->in[2];
  d->player.silent = 0;
  if ((d->has_last == 0u) || (seq != d->last_seq) || (type != d->last_type)) {
    d->last_result = carry_out(d, type, &d->in[3], (uint16_t)(d->in_count - 5u));
    d->last_seq = seq;
    d->last_type = type;
    d->has_last = 1u;
  }
  if (type == SRS_PING) { send_hello(d, seq); }
  if (type != SRS_PING) { send_status(d, seq, d->last_result); }
}

void srs_device_receive(srs_device *d, uint8_t byte) {
  if (byte == 0x7Eu) {
    if (d->too_long != 0u) {
      ++d->bad_frames;
    } else if (d->in_count > 0u) { take_frame(d); }
    d->in_count = 0;
    d->escaped = 0u;
    d->too_long = 0u;
  } else if (byte == 0x7Du) {
    d->escaped = 1u;
  } else if (d->in_count < SRS_FRAME_MAX) {
    d->in[d->in_count] = (d->escaped != 0u) ? (uint8_t)(byte ^ 0x20u) : byte;
    ++d->in_count;
    d->escaped = 0u;
  } else {
    d->too_long = 1u;
  }
}

srs_fault srs_device_init(srs_device *d, const srs_program *program) {
  (void)memset(d, 0, sizeof *d);
  return srs_player_init(&d->player, program);
}

void srs_device_tick(srs_device *d) {
  srs_player_tick(&d->player);
  if ((d->player.cycles != d->reported_cycles) || (d->player.state != d->reported_state)) {
    d->reported_cycles = d->player.cycles;
    d->reported_state = d->player.state;
    send_status(d, 0u, (uint8_t)SRS_OK);
  }
}

int16_t srs_device_send(srs_device *d) {
  int16_t byte = -1;
  if (d->out_count > 0u) {
    byte = d->out[d->out_first];
    d->out_first = (uint16_t)((d->out_first + 1u) % SRS_SEND_MAX);
    --d->out_count;
  }
  return byte;
}
