/* Encoder of Plumbline's radio node frames, version 1; the format is described in docs/guides/integrator/node.md.
 *
 * C99, no allocation, no dependencies. Copy this file into the firmware, fill in a plumbline_frame for every few samples, and send
 * the bytes that plumbline_encode writes. Licence: Apache-2.0.
 */
#ifndef PLUMBLINE_NODE_H
#define PLUMBLINE_NODE_H

#include <stddef.h>
#include <stdint.h>

#define PLUMBLINE_VERSION 1
#define PLUMBLINE_MOST_SAMPLES 40
#define PLUMBLINE_HEADER_BYTES 32
#define PLUMBLINE_LONGEST_FRAME (PLUMBLINE_HEADER_BYTES + 6 * PLUMBLINE_MOST_SAMPLES + 2)
#define PLUMBLINE_LONGEST_ENCODED (PLUMBLINE_LONGEST_FRAME + PLUMBLINE_LONGEST_FRAME / 254 + 2) /* with the delimiter */

#define PLUMBLINE_FLAG_BATTERY_LOW 0x01
#define PLUMBLINE_NO_TEMPERATURE (-32768)
#define PLUMBLINE_NO_BATTERY 0
#define PLUMBLINE_NO_SIGNAL 127

typedef struct {
    uint8_t flags;
    uint16_t boot;        /* another number after each reset: a counter in flash or retained memory, or a random number */
    uint32_t node;        /* number of the node */
    uint32_t sequence;    /* number of the first sample below since the start of the node */
    uint32_t scale_ng;    /* specific force per count, 1e-9 g */
    uint64_t t_us;        /* the node's clock at the last sample below */
    uint16_t full_scale;  /* smallest count that is at the end of the sensor's range */
    int16_t temperature;  /* 0.01 degree Celsius, or PLUMBLINE_NO_TEMPERATURE */
    uint16_t battery_mv;  /* or PLUMBLINE_NO_BATTERY */
    int8_t signal_dbm;    /* received power where it is known, or PLUMBLINE_NO_SIGNAL */
    uint8_t count;        /* number of samples, 1 to PLUMBLINE_MOST_SAMPLES */
    int16_t samples[PLUMBLINE_MOST_SAMPLES][3]; /* x, y, z */
} plumbline_frame;

/* CRC-16/CCITT-FALSE: polynomial 0x1021, start 0xFFFF, not reflected, no final exclusive or; "123456789" gives 0x29B1. */
static uint16_t plumbline_crc16(const uint8_t *data, size_t length)
{
    uint16_t crc = 0xFFFF;
    for (size_t i = 0; i < length; i++) {
        crc ^= (uint16_t)((uint16_t)data[i] << 8);
        for (int bit = 0; bit < 8; bit++) {
            crc = (uint16_t)((crc & 0x8000) ? (crc << 1) ^ 0x1021 : crc << 1);
        }
    }
    return crc;
}

static uint8_t *plumbline_put(uint8_t *at, uint64_t value, int bytes)
{
    for (int i = 0; i < bytes; i++) {
        *at++ = (uint8_t)(value >> (8 * i)); /* little-endian */
    }
    return at;
}

/* Write the frame with its delimiter to `out`, of at least PLUMBLINE_LONGEST_ENCODED bytes; return the number of bytes, 0 for a
 * frame with no or too many samples. */
static size_t plumbline_encode(const plumbline_frame *frame, uint8_t *out)
{
    uint8_t raw[PLUMBLINE_LONGEST_FRAME];
    uint8_t *at = raw;
    size_t length, code_at = 0, end = 1;

    if (frame->count < 1 || frame->count > PLUMBLINE_MOST_SAMPLES) {
        return 0;
    }
    at = plumbline_put(at, PLUMBLINE_VERSION, 1);
    at = plumbline_put(at, frame->flags, 1);
    at = plumbline_put(at, frame->boot, 2);
    at = plumbline_put(at, frame->node, 4);
    at = plumbline_put(at, frame->sequence, 4);
    at = plumbline_put(at, frame->scale_ng, 4);
    at = plumbline_put(at, frame->t_us, 8);
    at = plumbline_put(at, frame->full_scale, 2);
    at = plumbline_put(at, (uint16_t)frame->temperature, 2);
    at = plumbline_put(at, frame->battery_mv, 2);
    at = plumbline_put(at, (uint8_t)frame->signal_dbm, 1);
    at = plumbline_put(at, frame->count, 1);
    for (int i = 0; i < frame->count; i++) {
        for (int axis = 0; axis < 3; axis++) {
            at = plumbline_put(at, (uint16_t)frame->samples[i][axis], 2);
        }
    }
    at = plumbline_put(at, plumbline_crc16(raw, (size_t)(at - raw)), 2);
    length = (size_t)(at - raw);

    /* Consistent overhead byte stuffing: each zero becomes the distance to the next one, so that a zero can end the frame. */
    for (size_t i = 0; i < length; i++) {
        if (raw[i] != 0) {
            out[end++] = raw[i];
        }
        if (raw[i] == 0 || end - code_at == 255) {
            out[code_at] = (uint8_t)(end - code_at);
            code_at = end++;
        }
    }
    out[code_at] = (uint8_t)(end - code_at);
    out[end++] = 0;
    return end;
}

#endif
