/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * A virtual controller: a thread steps in real time, the main thread serves one XCP master after the other.
 *
 *   serve tcp|udp|frames HOST PORT MAX_CTO QUIET STIMULUS A2L
 *
 * PORT 0: any that is free. STIMULUS: a file with the inputs of all samples, pen_real_t[n][N_U], played again and again;
 * A2L: the file that GET_ID offers, or "-". `frames` is UDP with a CAN frame a datagram, without header. Prints its port; ends
 * with its standard input, and then prints the number of steps, and of late ones: more than a period after their time.
 *
 * TCP: a master that is gone without a word (its machine is off, its cable out) is noticed within GONE seconds, and the port
 * is free again. UDP: answers go to the master that was the last to send CONNECT; packets of others are dropped.
 */
#define _GNU_SOURCE

#include <arpa/inet.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "controller.h"
#include "penode/pen_port.h"
#include "xcp_frame.h"

#define SLOTS   8192U
#define ROOM    (XCP_FRAME_HEAD + 255U + XCP_FRAME_TAIL)
#define SECOND  1000000000LL
#define GONE    10 /* s */
#define CONNECT 0xffU

enum { WORD_KIND = 1, WORD_HOST, WORD_PORT, WORD_CTO, WORD_QUIET, WORD_STIMULUS, WORD_A2L, WORDS };

static uint8_t ring[SLOTS * 256U];
static uint8_t frame[ROOM];
static xcp_stream_t stream = { .frame = frame };
static MODEL(u_t) *stimulus;
static uint32_t stimuli;

/* Where answers go. */
static struct {
    int socket;
    bool datagrams;
    bool frames;             /* CAN */
    bool known;              /* a master has connected */
    struct sockaddr_in peer; /* that master            */
    struct sockaddr_in from; /* sender of the datagram */
} line = { .socket = -1 };

/* -- stepping ------------------------------------------------------------------------------------------------------- */

static int64_t nanoseconds(void)
{
    struct timespec now;

    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return ((int64_t)now.tv_sec * SECOND) + now.tv_nsec;
}

static void *stepping(void *unused)
{
    const int64_t period = (int64_t)CONTROLLER_PERIOD; /* ns */
    int64_t due = nanoseconds();

    for (uint32_t k = 0U;; k++) {
        controller_step(&stimulus[k % stimuli], (nanoseconds() - due) > period);
        due += period;
        const struct timespec next = { due / SECOND, due % SECOND };
        (void)clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, NULL);
    }
    return unused;
}

/* -- talking -------------------------------------------------------------------------------------------------------- */

static bool send_all(const uint8_t data[], size_t n)
{
    bool good = true;

    if (line.datagrams) {
        (void)sendto(line.socket, data, n, MSG_NOSIGNAL, (const struct sockaddr *)&line.peer, sizeof(line.peer));
    } else {
        while (good && (n > 0U)) {
            const ssize_t sent = send(line.socket, data, n, MSG_NOSIGNAL);
            good = (sent > 0);
            data += good ? sent : 0;
            n -= good ? (size_t)sent : 0U;
        }
    }
    return good;
}

/* A packet of n bytes at &message[XCP_FRAME_HEAD]. */
static bool send_packet(uint8_t message[], uint32_t n)
{
    bool good = true;

    if ((n > 0U) && line.frames) {
        good = send_all(&message[XCP_FRAME_HEAD], xcp_can_fill(n, stream.max, true, &message[XCP_FRAME_HEAD]));
    } else if (n > 0U) {
        good = send_all(message, xcp_stream_frame(&stream, n, message));
    }
    return good;
}

/* May its sender give commands? CONNECT makes it the master. */
static bool from_master(const uint8_t packet[], uint32_t n)
{
    if (line.datagrams && (n >= 2U) && (packet[0] == CONNECT)) {
        line.peer = line.from;
        line.known = true;
    }
    return !line.datagrams ||
           (line.known && (line.peer.sin_addr.s_addr == line.from.sin_addr.s_addr) && (line.peer.sin_port == line.from.sin_port));
}

static bool receive(const uint8_t packet[], uint32_t n)
{
    uint8_t message[ROOM];

    return !from_master(packet, n) || send_packet(message, pen_xcp_receive(&controller_xcp, packet, n, &message[XCP_FRAME_HEAD]));
}

static bool take(const uint8_t data[], size_t n)
{
    bool good = true;

    if (line.frames) {
        good = receive(data, (uint32_t)n);
    } else {
        for (size_t i = 0U; good && (i < n); i++) {
            const uint32_t packet = xcp_stream_take(&stream, data[i]);
            good = (packet == 0U) || receive(&frame[XCP_FRAME_HEAD], packet);
        }
    }
    return good;
}

/* What DAQ lists have sampled; several messages of a stream together. */
static bool send_samples(void)
{
    uint8_t batch[8192];
    size_t n = 0U;
    bool good = true;

    for (;;) {
        uint8_t message[ROOM];
        const uint32_t packet = pen_xcp_daq_packet(&controller_xcp, &message[XCP_FRAME_HEAD]);
        if (!good || (packet == 0U)) {
            break;
        }
        if (line.datagrams) {
            good = send_packet(message, packet);
        } else {
            const size_t bytes = xcp_stream_frame(&stream, packet, message);
            if ((n + bytes) > sizeof(batch)) {
                good = send_all(batch, n);
                n = 0U;
            }
            memcpy(&batch[n], message, bytes);
            n += bytes;
        }
    }
    return good && ((n == 0U) || send_all(batch, n));
}

static void hang_up(void)
{
    pen_xcp_disconnect(&controller_xcp);
    if (!line.datagrams) {
        close(line.socket);
        line.socket = -1;
    }
}

/* Probes once nothing has come for a while; and data that nobody acknowledges end the connection, too. */
static void notice_silence(int socket)
{
    const int on = 1, idle = GONE / 2, between = 1, probes = GONE / 2, limit = GONE * 1000;

    setsockopt(socket, IPPROTO_TCP, TCP_KEEPIDLE, &idle, sizeof(idle));
    setsockopt(socket, IPPROTO_TCP, TCP_KEEPINTVL, &between, sizeof(between));
    setsockopt(socket, IPPROTO_TCP, TCP_KEEPCNT, &probes, sizeof(probes));
    setsockopt(socket, IPPROTO_TCP, TCP_USER_TIMEOUT, &limit, sizeof(limit));
    setsockopt(socket, SOL_SOCKET, SO_KEEPALIVE, &on, sizeof(on));
}

static void answer_call(int listening)
{
    const int on = 1;
    const struct timeval patience = { 5, 0 };

    line.socket = accept(listening, NULL, NULL);
    setsockopt(line.socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
    setsockopt(line.socket, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof(patience));
    notice_silence(line.socket);
    xcp_stream_begin(&stream);
}

static bool listen_to_line(void)
{
    uint8_t data[4096];
    socklen_t size = sizeof(line.from);
    ssize_t n;
    bool good;

    if (line.datagrams) {
        n = recvfrom(line.socket, data, sizeof(data), 0, (struct sockaddr *)&line.from, &size);
        xcp_stream_begin(&stream);
        good = take(data, (n > 0) ? (size_t)n : 0U);
    } else {
        n = recv(line.socket, data, sizeof(data), 0);
        good = (n > 0) && take(data, (size_t)n);
    }
    return good;
}

static void elapse(int64_t *before)
{
    uint8_t message[ROOM];
    const int64_t now = nanoseconds();
    const uint32_t ms = (uint32_t)((now - *before) / 1000000);
    const uint32_t n = pen_xcp_elapse(&controller_xcp, ms, &message[XCP_FRAME_HEAD]);

    *before += (int64_t)ms * 1000000;
    if ((line.socket >= 0) && !send_packet(message, n)) {
        hang_up();
    }
}

static void serve(int listening)
{
    int64_t before = nanoseconds();

    for (;;) {
        const bool sampling = pen_port_load(&controller_xcp.sampling) != 0U;
        struct pollfd ready[2] = { { 0, POLLIN, 0 }, { (line.socket >= 0) ? line.socket : listening, POLLIN, 0 } };
        (void)poll(ready, 2U, sampling ? 1 : 10);
        if (ready[0].revents != 0) {
            break;
        }
        if ((ready[1].revents != 0) && (line.socket < 0)) {
            answer_call(listening);
        } else if ((ready[1].revents != 0) && !listen_to_line()) {
            hang_up();
        }
        if ((line.socket >= 0) && (line.known || !line.datagrams) && !send_samples()) {
            hang_up();
        }
        elapse(&before);
    }
}

/* -- beginning ------------------------------------------------------------------------------------------------------ */

/* All of a file; ends the program if it cannot be read. */
static void *read_file(const char *name, size_t *size)
{
    FILE *const file = fopen(name, "rb");
    void *byte = NULL;
    long end = -1L;

    if ((file != NULL) && (fseek(file, 0L, SEEK_END) == 0)) {
        end = ftell(file);
    }
    if (end >= 0L) {
        *size = (size_t)end;
        byte = malloc(*size + 1U);
    }
    if ((byte == NULL) || (fseek(file, 0L, SEEK_SET) != 0) || (fread(byte, 1U, *size, file) != *size)) {
        perror(name);
        exit(1);
    }
    (void)fclose(file);
    return byte;
}

/* A socket that is bound; prints its port. */
static int bind_to(const char *host, const char *port)
{
    const int found = socket(AF_INET, line.datagrams ? SOCK_DGRAM : SOCK_STREAM, 0);
    const int on = 1;
    struct sockaddr_in at = { .sin_family = AF_INET, .sin_port = htons((uint16_t)strtoul(port, NULL, 10)) };
    socklen_t size = sizeof(at);

    if ((found < 0) || (setsockopt(found, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on)) != 0) ||
        (inet_pton(AF_INET, host, &at.sin_addr) != 1) || (bind(found, (struct sockaddr *)&at, size) != 0) ||
        (getsockname(found, (struct sockaddr *)&at, &size) != 0) || (!line.datagrams && (listen(found, 1) != 0))) {
        perror("serve");
        exit(3);
    }
    printf("%d\n", ntohs(at.sin_port));
    (void)fflush(stdout);
    return found;
}

int main(int count, char *word[])
{
    static controller_config_t config = { .ring = ring, .slots = SLOTS };
    pthread_t thread;
    size_t size = 0U;

    if (count != WORDS) {
        return 2;
    }
    line.frames = strcmp(word[WORD_KIND], "frames") == 0;
    line.datagrams = line.frames || (strcmp(word[WORD_KIND], "udp") == 0);
    config.max_cto = (uint32_t)strtoul(word[WORD_CTO], NULL, 10);
    config.quiet = (uint32_t)strtoul(word[WORD_QUIET], NULL, 10);
    stream.max = config.max_cto;
    stimulus = read_file(word[WORD_STIMULUS], &size);
    stimuli = (uint32_t)(size / sizeof(*stimulus));
    if (strcmp(word[WORD_A2L], "-") != 0) {
        config.a2l = read_file(word[WORD_A2L], &size);
        config.a2l_size = (uint32_t)size;
    }
    if ((stimuli == 0U) || !controller_start(&config)) {
        return 2;
    }
    const int listening = bind_to(word[WORD_HOST], word[WORD_PORT]);
    line.socket = line.datagrams ? listening : -1;
    if (pthread_create(&thread, NULL, stepping, NULL) != 0) {
        return 1;
    }
    serve(listening);
    printf("%u %u\n", (unsigned)controller_samples(), (unsigned)controller_late());
    return 0;
}
