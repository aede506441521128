/* The line between pilot and robot: framing, checksum, messages. Byte by byte: docs/howto/firmware.md. */
#ifndef SRS_LINK_H
#define SRS_LINK_H
#include "srs_player.h"

#define SRS_PROTOCOL 1u
#define SRS_FRAME_MAX (16u + SRS_MAX_EVENTS * (2u + 4u * SRS_WORDS)) /* header, longest payload, checksum */
#define SRS_SEND_MAX 160u

enum { SRS_PING = 1, SRS_SELECT = 2, SRS_VENT = 3, SRS_RUN = 4, SRS_QUERY = 5, SRS_CYCLE = 6 };
enum { SRS_HELLO = 0x81, SRS_STATUS = 0x82 };

typedef struct {
  srs_player player;
  uint8_t in[SRS_FRAME_MAX]; /* of the frame that is coming in */
  uint16_t in_count;
  uint8_t escaped, too_long;
  uint8_t last_type, last_seq, has_last; /* a repeated command is answered, not carried out again */
  uint8_t last_result;
  uint16_t bad_frames;
  uint8_t out[SRS_SEND_MAX]; /* ring of bytes to be sent */
  uint16_t out_first, out_count;
  uint32_t reported_cycles;
  srs_state reported_state;
} srs_device;

/* Start vented, with an empty line. */
srs_fault srs_device_init(srs_device *d, const srs_program *program);

/* A byte came from the line. */
void srs_device_receive(srs_device *d, uint8_t byte);

/* One tick: plays, and reports every cycle that starts and every change of state. */
void srs_device_tick(srs_device *d);

/* The next byte for the line, or -1. */
int16_t srs_device_send(srs_device *d);
#endif
