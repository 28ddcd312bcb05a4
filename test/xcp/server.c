/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * A virtual controller: nqvm steps in one thread at 1 kHz, the XCP slave serves one master after the other over TCP, or
 * over UDP. server tcp|udp [MAX_CTO [QUIET]] prints its port; ends with its standard input.
 */
#include <arpa/inet.h>
#include <poll.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "nqvm.h"
#include "penode/pen_port.h"
#include "penode/pen_xcp.h"
#include "xcp_frame.h"

static nqvm_t model;
static nqvm_banks_t banks;
static pen_xcp_t xcp;

/* What a master may read; written by the thread that steps. */
static struct {
    uint32_t samples;
    uint32_t id;         /* of the set in force                    */
    uint32_t adopted_at; /* sample of the last adoption            */
    float z_b;
} shown;

static pen_status_t commit(void)
{
    return nqvm_tune_commit(&model);
}
static pen_status_t choose(const pen_set_t *set)
{
    return nqvm_tune_select(&model, set);
}

static const uint8_t name[] = "nqvm";
static const uint8_t epk[] = "nqvm 0.1.0 test";
static const pen_xcp_region_t name_text = { 0U, sizeof(name) - 1U, name };
static const pen_xcp_region_t epk_text = { 0x2000U, sizeof(epk) - 1U, epk };
static const pen_xcp_region_t regions[] = {
    { 0x1000U, sizeof(shown), (const uint8_t *)&shown },
    { 0x2000U, sizeof(epk) - 1U, epk },
};
static pen_xcp_config_t config = {
    .instance = &model.head,
    .layout = NQVM_LAYOUT,
    .length = NQVM_SET_LENGTH,
    .reference = &nqvm_set_default,
    .commit = commit,
    .select = choose,
    .address = 0x10000U,
    .id = 1000U,
    .regions = 2U,
    .region = regions,
    .text = { &name_text, &name_text, NULL, NULL, NULL, &epk_text },
};

static void *stepping(void *unused)
{
    struct timespec next;

    clock_gettime(CLOCK_MONOTONIC, &next);
    for (uint32_t k = 0U;; k++) {
        const nqvm_u_t u = { (pen_real_t)(k % 250U) * (pen_real_t)0.0001 };
        nqvm_y_t y;
        pen_set_head_t running;
        const pen_status_t status = nqvm_step(&model, &u, &y);
        (void)nqvm_tune_running(&model, &running);
        shown.z_b = (float)y.z_b;
        shown.id = running.id;
        if ((status & PEN_ADOPTED) != 0U) {
            shown.adopted_at = k + 1U;
        }
        pen_port_barrier();
        pen_port_store(&shown.samples, k + 1U);
        next.tv_nsec += 1000000;
        if (next.tv_nsec >= 1000000000) {
            next.tv_nsec -= 1000000000;
            next.tv_sec++;
        }
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, NULL);
    }
    return unused;
}

static uint8_t frame[XCP_FRAME_HEAD + 255U + XCP_FRAME_TAIL];
static uint8_t message[XCP_FRAME_HEAD + 255U + XCP_FRAME_TAIL];
static xcp_stream_t stream = { .frame = frame };

/* Bytes that came from a master: the answers go back. */
static void serve(int to, const uint8_t data[], size_t n, const struct sockaddr_in *peer)
{
    for (size_t i = 0U; i < n; i++) {
        const uint32_t packet = xcp_stream_take(&stream, data[i]);
        const uint32_t answer = (packet == 0U) ? 0U : pen_xcp_receive(&xcp, &frame[XCP_FRAME_HEAD], packet, &message[XCP_FRAME_HEAD]);
        if (answer > 0U) {
            const size_t bytes = xcp_stream_frame(&stream, answer, message);
            if (sendto(to, message, bytes, MSG_NOSIGNAL, (const struct sockaddr *)peer, (peer != NULL) ? sizeof(*peer) : 0U) < 0) {
                return;
            }
        }
    }
}

static void event(int to, uint32_t ms, const struct sockaddr_in *peer)
{
    const uint32_t n = pen_xcp_elapse(&xcp, ms, &message[XCP_FRAME_HEAD]);

    if (n > 0U) {
        (void)sendto(to, message, xcp_stream_frame(&stream, n, message), MSG_NOSIGNAL, (const struct sockaddr *)peer,
                     (peer != NULL) ? sizeof(*peer) : 0U);
    }
}

int main(int count, char *word[])
{
    const bool tcp = strcmp(word[1], "tcp") == 0;
    const int listening = socket(AF_INET, tcp ? SOCK_STREAM : SOCK_DGRAM, 0);
    struct sockaddr_in at = { .sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK) };
    socklen_t size = sizeof(at);
    struct sockaddr_in peer = at;
    int line = tcp ? -1 : listening;
    pthread_t thread;

    config.max_cto = (count > 2) ? (uint32_t)atoi(word[2]) : 252U;
    config.quiet = (count > 3) ? (uint32_t)atoi(word[3]) : 0U;
    stream.max = config.max_cto;
    if ((nqvm_init(&model, &nqvm_set_default, &banks) != PEN_OK) || (pen_xcp_init(&xcp, &config) != PEN_OK) ||
        (bind(listening, (struct sockaddr *)&at, size) != 0) || (getsockname(listening, (struct sockaddr *)&at, &size) != 0) ||
        (tcp && (listen(listening, 1) != 0)) || (pthread_create(&thread, NULL, stepping, NULL) != 0)) {
        return 1;
    }
    printf("%d\n", ntohs(at.sin_port));
    fflush(stdout);
    for (;;) {
        struct pollfd ready[3] = { { 0, POLLIN, 0 }, { listening, POLLIN, 0 }, { line, POLLIN, 0 } };
        uint8_t data[2048];
        ssize_t n;
        const int found = poll(ready, 3U, 10);
        if (found == 0) {
            event(line, 10U, tcp ? NULL : &peer);
        }
        if (ready[0].revents != 0) {
            return 0;
        }
        if (tcp && (line < 0) && (ready[1].revents != 0)) {
            line = accept(listening, NULL, NULL);
            xcp_stream_begin(&stream);
        } else if (tcp && (line >= 0) && (ready[2].revents != 0)) {
            n = recv(line, data, sizeof(data), 0);
            if (n <= 0) {
                close(line);
                line = -1;
                pen_xcp_disconnect(&xcp);
            } else {
                serve(line, data, (size_t)n, NULL);
            }
        } else if (!tcp && (ready[1].revents != 0)) {
            size = sizeof(peer);
            n = recvfrom(line, data, sizeof(data), 0, (struct sockaddr *)&peer, &size);
            xcp_stream_begin(&stream);
            serve(line, data, (n > 0) ? (size_t)n : 0U, &peer);
        }
    }
}
