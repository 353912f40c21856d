/* A Modbus peer that follows a script: what it sends, byte by byte, for each request; over TCP or a pseudo-terminal. */
#ifndef MODBUS_PEER_H
#define MODBUS_PEER_H

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <pthread.h>
#include <pty.h>
#include <stdatomic.h>
#include <sys/socket.h>
#include <termios.h>

#include "device/modbus.h"
#include "device_rig.h"

enum { PEER_REQUESTS_MAX = 32, PEER_FRAME = 300 };

/* What is done with a good answer before it is sent. */
enum peer_act {
	ANSWER,       /* nothing */
	SILENCE,      /* it is not sent */
	HALF,         /* its first half is */
	UNIT,         /* it is from another unit */
	CRC,          /* a bit of it is wrong (RTU) */
	EXCEPTION,    /* it is refused: illegal data address */
	BUSY,         /* it is refused: busy */
	PREVIOUS,     /* the answer to the request before comes instead */
	PREVIOUS_TOO, /* the answer to the request before comes first */
	LENGTH,       /* the header says another length (TCP), or the answer is of another one (RTU) */
	FUNCTION,     /* it is to another function */
	PROTOCOL,     /* it is of another protocol (TCP) */
	TWICE,        /* it comes twice */
	CLOSE,        /* the connection is closed in the middle of it */
	LATE,         /* it comes with the next request */
};

typedef struct {
	bool serial;
	const enum peer_act *acts; /* one a request; ANSWER past the last */
	size_t count;
	/* the peer's */
	int listener, line;
	int port;
	char path[64];
	pthread_t thread;
	int wake[2];
	uint8_t previous[PEER_FRAME], late[PEER_FRAME];
	size_t previous_length, late_length;
	atomic_uint requests, connections;
	uint8_t functions[PEER_REQUESTS_MAX]; /* of the requests that came */
	uint16_t registers[128];
} peer;

static inline uint16_t peer_crc(const uint8_t *bytes, size_t n)
{
	uint16_t crc = 0xFFFF;
	for (size_t i = 0; i < n; i++) {
		crc ^= bytes[i];
		for (int k = 0; k < 8; k++)
			crc = (uint16_t)((crc & 1) != 0 ? crc >> 1 ^ 0xA001 : crc >> 1);
	}
	return crc;
}

/* Header or checksum put around a PDU: the length of the frame. */
static inline size_t peer_frame(const peer *p, const uint8_t *request, unsigned unit, const uint8_t *pdu, size_t n,
								uint8_t *frame)
{
	if (p->serial) {
		frame[0] = (uint8_t)unit;
		memcpy(frame + 1, pdu, n);
		const uint16_t crc = peer_crc(frame, n + 1);
		frame[n + 1] = (uint8_t)crc;
		frame[n + 2] = (uint8_t)(crc >> 8);
		return n + 3;
	}
	memcpy(frame, request, 4);
	frame[4] = (uint8_t)((n + 1) >> 8);
	frame[5] = (uint8_t)(n + 1);
	frame[6] = (uint8_t)unit;
	memcpy(frame + 7, pdu, n);
	return n + 7;
}

/* What a device with these registers answers, as a PDU. Bits are those of the low bytes of the registers. */
static inline size_t peer_answer(peer *p, const uint8_t *request, uint8_t *pdu)
{
	const unsigned address = (unsigned)request[1] << 8 | request[2], n = (unsigned)request[3] << 8 | request[4];
	const bool read = request[0] <= 4, bits = request[0] <= 2;
	pdu[0] = request[0];
	if (address + (read ? n : 1) > COUNT(p->registers)) {
		pdu[0] |= 0x80;
		pdu[1] = 2;
		return 2;
	}
	if (!read) {
		for (unsigned i = 0; request[0] == 16 && i < n; i++)
			p->registers[address + i] = (uint16_t)(request[6 + 2 * i] << 8 | request[7 + 2 * i]);
		if (request[0] == 6)
			p->registers[address] = (uint16_t)n;
		memcpy(pdu + 1, request + 1, 4);
		return 5;
	}
	pdu[1] = (uint8_t)(bits ? (n + 7) / 8 : 2 * n);
	memset(pdu + 2, 0, pdu[1]);
	for (unsigned i = 0; i < n; i++) {
		if (bits) {
			pdu[2 + i / 8] |= (uint8_t)((p->registers[address + i] & 1) << (i % 8));
			continue;
		}
		pdu[2 + 2 * i] = (uint8_t)(p->registers[address + i] >> 8);
		pdu[3 + 2 * i] = (uint8_t)p->registers[address + i];
	}
	return 2u + pdu[1];
}

static inline void peer_send(const peer *p, const uint8_t *frame, size_t n)
{
	if (p->serial)
		(void)!write(p->line, frame, n);
	else
		(void)!send(p->line, frame, n, MSG_NOSIGNAL);
}

/* A good answer after what the script does to it; false: hang up. */
static inline bool peer_reply(peer *p, enum peer_act act, const uint8_t *request, const uint8_t *request_pdu)
{
	uint8_t frame[2 * PEER_FRAME], pdu[PEER_FRAME];
	unsigned unit = 1;
	size_t n = peer_answer(p, request_pdu, pdu);
	if (act == EXCEPTION || act == BUSY) {
		pdu[0] |= 0x80;
		pdu[1] = act == BUSY ? 6 : 2;
		n = 2;
	}
	if (act == FUNCTION)
		pdu[0] ^= 7;
	if (act == LENGTH && p->serial) {
		pdu[1] = (uint8_t)(pdu[1] - 2);
		n -= 2;
	}
	unit = act == UNIT ? 7 : 1;
	n = peer_frame(p, request, unit, pdu, n, frame);
	if (p->late_length > 0)
		peer_send(p, p->late, p->late_length);
	p->late_length = 0;
	if (act == LENGTH && !p->serial)
		frame[5]++;
	if (act == PROTOCOL)
		frame[3] = 1;
	if (act == CRC)
		frame[n - 3] ^= 4;
	if (act == LATE) {
		memcpy(p->late, frame, n);
		p->late_length = n;
	}
	if (act == PREVIOUS || act == PREVIOUS_TOO)
		peer_send(p, p->previous, p->previous_length);
	memcpy(frame + n, frame, n);
	if (act != SILENCE && act != PREVIOUS && act != LATE)
		peer_send(p, frame, act == HALF || act == CLOSE ? n / 2 : act == TWICE ? 2 * n : n);
	memcpy(p->previous, frame, n);
	p->previous_length = n;
	return act != CLOSE;
}

/* One whole request: its length, 0 at the end of the connection. */
static inline size_t peer_receive(const peer *p, uint8_t *request)
{
	size_t n = 0, needed = p->serial ? 8 : 6;
	while (n < needed) {
		struct pollfd ready[2] = {{p->line, POLLIN, 0}, {p->wake[0], POLLIN, 0}};
		poll(ready, 2, -1);
		const ssize_t got = ready[1].revents != 0 ? 0 : read(p->line, request + n, needed - n);
		if (got <= 0)
			return 0;
		n += (size_t)got;
		if (!p->serial && n >= 6)
			needed = 6 + ((size_t)request[4] << 8 | request[5]);
		if (p->serial && n >= 7 && request[1] >= 15)
			needed = 9u + request[6];
	}
	return n;
}

static inline void peer_talk(peer *p)
{
	uint8_t request[PEER_FRAME];
	while (peer_receive(p, request) > 0) {
		const uint8_t *pdu = request + (p->serial ? 1 : 7);
		const unsigned i = p->requests++;
		if (i < PEER_REQUESTS_MAX)
			p->functions[i] = pdu[0];
		if (!peer_reply(p, i < p->count ? p->acts[i] : ANSWER, request, pdu))
			return;
	}
}

static inline void *peer_run(void *context)
{
	peer *p = context;
	if (p->serial) {
		peer_talk(p);
		return NULL;
	}
	for (;;) {
		struct pollfd ready[2] = {{p->listener, POLLIN, 0}, {p->wake[0], POLLIN, 0}};
		poll(ready, 2, -1);
		if (ready[1].revents != 0)
			return NULL;
		p->line = accept(p->listener, NULL, NULL);
		p->connections++;
		p->late_length = 0; /* what was under way on the old connection is gone */
		peer_talk(p);
		close(p->line);
	}
}

static inline void peer_start(peer *p)
{
	for (size_t i = 0; i < COUNT(p->registers); i++)
		p->registers[i] = (uint16_t)(1000 + i);
	assert_int_equal(pipe(p->wake), 0);
	if (p->serial) {
		int slave;
		struct termios raw;
		assert_int_equal(openpty(&p->line, &slave, p->path, NULL, NULL), 0);
		tcgetattr(slave, &raw);
		cfmakeraw(&raw);
		tcsetattr(slave, TCSANOW, &raw);
		p->listener = slave; /* kept open, or the line would hang up between two clients */
	} else {
		struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
		socklen_t size = sizeof(address);
		p->listener = socket(AF_INET, SOCK_STREAM, 0);
		assert_int_equal(bind(p->listener, (struct sockaddr *)&address, size), 0);
		assert_int_equal(listen(p->listener, 4), 0);
		getsockname(p->listener, (struct sockaddr *)&address, &size);
		p->port = ntohs(address.sin_port);
	}
	pthread_create(&p->thread, NULL, peer_run, p);
}

static inline void peer_stop(peer *p)
{
	(void)!write(p->wake[1], "", 1);
	pthread_join(p->thread, NULL);
	close(p->wake[0]);
	close(p->wake[1]);
	close(p->listener);
	if (p->serial)
		close(p->line);
}

#endif
