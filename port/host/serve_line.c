/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

#define _GNU_SOURCE

#include "serve_line.h"

#include <arpa/inet.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "controller.h"
#include "penode/pen_port.h"
#include "xcp_frame.h"

#define ROOM    (XCP_FRAME_HEAD + 255U + XCP_FRAME_TAIL)
#define CALLS   8
#define SILENT  2 /* s */
#define GONE    10 /* s */
#define CONNECT 0xffU
#define ERROR   0xfeU
#define LATER   0x33U /* ERR_RESOURCE_TEMPORARY_NOT_ACCESSIBLE */

/* A connection; of UDP, all datagrams. */
typedef struct {
    int socket;    /* -1: none                              */
    int64_t since; /* ms: it is open, or has no session     */
    xcp_stream_t stream;
    uint8_t frame[ROOM];
} call_t;

static call_t calls[CALLS];
static call_t *master; /* who gives commands; NULL: nobody */

static struct {
    int listening;
    bool datagrams;
    bool frames; /* CAN */
    uint32_t max_cto;
    struct sockaddr_in peer; /* UDP: the master            */
    struct sockaddr_in from; /* UDP: sender of the datagram */
} line = { .listening = -1 };

static int64_t milliseconds(void)
{
    struct timespec now;

    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return ((int64_t)now.tv_sec * 1000) + (now.tv_nsec / 1000000);
}

/* -- sending -------------------------------------------------------------------------------------------------------- */

static bool send_all(const call_t *call, const uint8_t data[], size_t n)
{
    const int wait = (call == master) ? 0 : MSG_DONTWAIT; /* nobody else holds the master up */
    bool good = true;

    if (line.datagrams) {
        (void)sendto(call->socket, data, n, MSG_NOSIGNAL, (const struct sockaddr *)&line.peer, sizeof(line.peer));
    } else {
        while (good && (n > 0U)) {
            const ssize_t sent = send(call->socket, data, n, MSG_NOSIGNAL | wait);
            good = (sent > 0);
            data += good ? sent : 0;
            n -= good ? (size_t)sent : 0U;
        }
    }
    return good;
}

/* A packet of n bytes at &message[XCP_FRAME_HEAD]. */
static bool send_packet(call_t *call, uint8_t message[], uint32_t n)
{
    bool good = true;

    if ((n > 0U) && line.frames) {
        good = send_all(call, &message[XCP_FRAME_HEAD], xcp_can_fill(n, line.max_cto, true, &message[XCP_FRAME_HEAD]));
    } else if (n > 0U) {
        good = send_all(call, message, xcp_stream_frame(&call->stream, n, message));
    }
    return good;
}

/* What DAQ lists have sampled; several messages of a stream together. */
static bool send_samples(call_t *call)
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
            good = send_packet(call, message, packet);
        } else {
            const size_t bytes = xcp_stream_frame(&call->stream, packet, message);
            if ((n + bytes) > sizeof(batch)) {
                good = send_all(call, batch, n);
                n = 0U;
            }
            memcpy(&batch[n], message, bytes);
            n += bytes;
        }
    }
    return good && ((n == 0U) || send_all(call, batch, n));
}

/* -- receiving ------------------------------------------------------------------------------------------------------ */

/* May its sender give commands? CONNECT makes it the master, while there is no session of another. */
static bool from_master(call_t *call, bool connect)
{
    if (line.datagrams && connect) {
        line.peer = line.from;
        master = call;
    } else if (connect && (call != master) && !((master != NULL) && controller_xcp.connected)) {
        pen_xcp_disconnect(&controller_xcp);
        master = call;
    } else {
        /* as it is */
    }
    return (call == master) &&
           (!line.datagrams || ((line.peer.sin_addr.s_addr == line.from.sin_addr.s_addr) && (line.peer.sin_port == line.from.sin_port)));
}

static bool receive(call_t *call, const uint8_t packet[], uint32_t n)
{
    const bool connect = (n >= 2U) && (packet[0] == CONNECT);
    uint8_t message[ROOM];
    uint32_t answer = 0U;

    if (from_master(call, connect)) {
        answer = pen_xcp_receive(&controller_xcp, packet, n, &message[XCP_FRAME_HEAD]);
        call->since = milliseconds();
    } else if (connect) {
        message[XCP_FRAME_HEAD] = ERROR;
        message[XCP_FRAME_HEAD + 1U] = LATER;
        answer = 2U;
    } else {
        /* not connected: no answer */
    }
    return send_packet(call, message, answer);
}

static bool take(call_t *call, const uint8_t data[], size_t n)
{
    bool good = true;

    if (line.frames) {
        good = receive(call, data, (uint32_t)n);
    } else {
        for (size_t i = 0U; good && (i < n); i++) {
            const uint32_t packet = xcp_stream_take(&call->stream, data[i]);
            good = (packet == 0U) || receive(call, &call->frame[XCP_FRAME_HEAD], packet);
        }
    }
    return good;
}

static bool listen_to(call_t *call)
{
    uint8_t data[4096];
    socklen_t size = sizeof(line.from);
    ssize_t n;
    bool good;

    if (line.datagrams) {
        n = recvfrom(call->socket, data, sizeof(data), 0, (struct sockaddr *)&line.from, &size);
        xcp_stream_begin(&call->stream);
        good = take(call, data, (n > 0) ? (size_t)n : 0U);
    } else {
        n = recv(call->socket, data, sizeof(data), 0);
        good = (n > 0) && take(call, data, (size_t)n);
    }
    return good;
}

/* -- connections ---------------------------------------------------------------------------------------------------- */

static void begin(call_t *call, int socket)
{
    call->socket = socket;
    call->since = milliseconds();
    call->stream = (xcp_stream_t){ .max = line.max_cto, .frame = call->frame };
}

static void hang_up(call_t *call)
{
    if (call == master) {
        pen_xcp_disconnect(&controller_xcp);
        master = NULL;
    }
    if (!line.datagrams) {
        close(call->socket);
        call->socket = -1;
    }
}

/* Where a new connection goes: a free place, or that of the one that has been silent longest. NULL: none yet. */
static call_t *place(void)
{
    const int64_t limit = milliseconds() - (SILENT * 1000);
    call_t *found = NULL;

    for (int i = 0; i < CALLS; i++) {
        call_t *const call = &calls[i];
        if (call->socket < 0) {
            return call;
        }
        const bool waits = !((call == master) && controller_xcp.connected) && (call->since <= limit);
        if (waits && ((found == NULL) || (call->since < found->since))) {
            found = call;
        }
    }
    return found;
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

static void answer_call(call_t *call)
{
    const int on = 1;
    const struct timeval patience = { 5, 0 };
    const int socket = accept(line.listening, NULL, NULL);

    if (socket >= 0) {
        if (call->socket >= 0) {
            hang_up(call);
        }
        setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
        setsockopt(socket, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof(patience));
        notice_silence(socket);
        begin(call, socket);
    }
}

/* Time for `quiet`. */
static void elapse(int64_t *before)
{
    uint8_t message[ROOM];
    const int64_t now = milliseconds();
    const uint32_t n = pen_xcp_elapse(&controller_xcp, (uint32_t)(now - *before), &message[XCP_FRAME_HEAD]);

    *before = now;
    if ((master != NULL) && !send_packet(master, message, n)) {
        hang_up(master);
    }
}

void line_serve(void (*pass)(void))
{
    int64_t before = milliseconds();

    for (;;) {
        const bool sampling = pen_port_load(&controller_xcp.sampling) != 0U;
        const bool room = !line.datagrams && (place() != NULL);
        struct pollfd ready[CALLS + 2] = { { 0, POLLIN, 0 }, { room ? line.listening : -1, POLLIN, 0 } };
        for (int i = 0; i < CALLS; i++) {
            ready[i + 2] = (struct pollfd){ calls[i].socket, POLLIN, 0 };
        }
        (void)poll(ready, CALLS + 2, sampling ? 1 : 10);
        if (ready[0].revents != 0) {
            break;
        }
        for (int i = 0; i < CALLS; i++) {
            if ((ready[i + 2].revents != 0) && !listen_to(&calls[i])) {
                hang_up(&calls[i]);
            }
        }
        call_t *const now = (ready[1].revents != 0) ? place() : NULL; /* the other one may have become the master */
        if (now != NULL) {
            answer_call(now);
        }
        if ((master != NULL) && !send_samples(master)) {
            hang_up(master);
        }
        elapse(&before);
        pass();
    }
}

uint16_t line_open(const char *kind, const char *host, const char *port, uint32_t max_cto)
{
    const int on = 1;
    struct sockaddr_in at = { .sin_family = AF_INET, .sin_port = htons((uint16_t)strtoul(port, NULL, 10)) };
    socklen_t size = sizeof(at);

    line.frames = strcmp(kind, "frames") == 0;
    line.datagrams = line.frames || (strcmp(kind, "udp") == 0);
    line.max_cto = max_cto;
    for (int i = 0; i < CALLS; i++) {
        calls[i].socket = -1;
    }
    const int found = socket(AF_INET, line.datagrams ? SOCK_DGRAM : SOCK_STREAM, 0);
    if ((found < 0) || (setsockopt(found, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on)) != 0) ||
        (inet_pton(AF_INET, host, &at.sin_addr) != 1) || (bind(found, (struct sockaddr *)&at, size) != 0) ||
        (getsockname(found, (struct sockaddr *)&at, &size) != 0) || (!line.datagrams && (listen(found, CALLS) != 0))) {
        return 0U;
    }
    line.listening = found;
    if (line.datagrams) {
        begin(&calls[0], found);
    }
    return ntohs(at.sin_port);
}
