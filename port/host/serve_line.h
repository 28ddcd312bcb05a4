/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/**
 * The line between a virtual controller and its XCP master: TCP, UDP, or UDP with a CAN frame a datagram, without header.
 *
 * TCP: whoever sends CONNECT while none is connected is the master. Connections that have not sent it wait, and keep nobody out; where
 * CALLS of them are open, the one that has waited longest, and for SILENT seconds, is closed for a new one. While a master is
 * connected, the CONNECT of another is answered with ERR_RESOURCE_TEMPORARY_NOT_ACCESSIBLE; its connection stays, and it may try again. A master that
 * is gone without a word (its machine is off, its cable out) is noticed within GONE seconds, and others can connect again.
 *
 * UDP has no connections: answers go to the master that was the last to send CONNECT, packets of others are dropped.
 */
#ifndef SERVE_LINE_H
#define SERVE_LINE_H

#include <stdbool.h>
#include <stdint.h>

/** Listen. @param kind  tcp, udp or frames @param port  "0": any that is free @return the port; 0: refused, errno says why */
uint16_t line_open(const char *kind, const char *host, const char *port, uint32_t max_cto);

/** Serve controller_xcp, and call `pass` about every 10 ms, until the standard input ends. */
void line_serve(void (*pass)(void));

#endif
