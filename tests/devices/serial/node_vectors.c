/* Writes frames with the reference encoder, one line of hexadecimal digits each: the vectors in tests/data/node_vectors.txt. */
#include "plumbline_node.h"
#include <stdio.h>
#include <string.h>

static void print_encoded(const plumbline_frame *frame)
{
    uint8_t out[PLUMBLINE_LONGEST_ENCODED];
    size_t length = plumbline_encode(frame, out);
    for (size_t i = 0; i < length; i++) {
        printf("%02x", out[i]);
    }
    printf("\n");
}

int main(void)
{
    plumbline_frame frame = {
        .flags = 0, .boot = 3, .node = 7, .sequence = 1000, .scale_ng = 61035, .t_us = 12500000, .full_scale = 32767,
        .temperature = 2150, .battery_mv = 3712, .signal_dbm = -67, .count = 2,
        .samples = {{0, 0, 16384}, {-82, 41, 16380}},
    };
    print_encoded(&frame); /* the worked example of docs/guides/integrator/node.md */

    frame = (plumbline_frame){
        .flags = PLUMBLINE_FLAG_BATTERY_LOW, .boot = 65535, .node = 4294967295u, .sequence = 4294967295u, .scale_ng = 4294967295u,
        .t_us = 18446744073709551615u, .full_scale = 65535, .temperature = -2150, .battery_mv = 65535, .signal_dbm = -128,
        .count = PLUMBLINE_MOST_SAMPLES,
    };
    memset(frame.samples, 0xA5, sizeof frame.samples); /* more than 254 bytes without a zero */
    print_encoded(&frame);

    memset(frame.samples, 0, sizeof frame.samples);
    frame.temperature = PLUMBLINE_NO_TEMPERATURE;
    frame.battery_mv = PLUMBLINE_NO_BATTERY;
    frame.signal_dbm = PLUMBLINE_NO_SIGNAL;
    print_encoded(&frame);

    uint32_t random = 1;
    for (int number = 0; number < 200; number++) {
        for (int i = 0; i < 3 * PLUMBLINE_MOST_SAMPLES; i++) {
            random = random * 1664525u + 1013904223u; /* Numerical Recipes, a linear congruential generator */
            frame.samples[i / 3][i % 3] = (int16_t)((random >> 16) % (number % 4 ? 65536 : 3));
        }
        frame.flags = number & 1;
        frame.boot = (uint16_t)(random >> 20);
        frame.node = random;
        frame.sequence = random * 3;
        frame.scale_ng = 1 + (random >> 8);
        frame.t_us = (uint64_t)random << (number % 33);
        frame.full_scale = (uint16_t)(1 + (random >> 17));
        frame.temperature = (int16_t)(random >> 18);
        frame.battery_mv = (uint16_t)(1 + (random >> 19));
        frame.signal_dbm = (int8_t)(-(int)(random >> 25));
        frame.count = (uint8_t)(1 + number % PLUMBLINE_MOST_SAMPLES);
        print_encoded(&frame);
    }
    return 0;
}
