/*
 * Loops for scripts/bench that would drown in the cost of a call from Python: the lock-in block by block, the lock-in
 * that everybody writes first, and how fast this machine reads memory.
 */
#include <math.h>
#include <modbus.h>
#include <netinet/in.h>
#include <stddef.h>
#include <stdint.h>

#include <tactus/tactus.h>

#include "fit/fit_internal.h"

void bench_lockin(const float *samples_V, size_t blocks, size_t n, double rate_Hz, double frequency_Hz,
				  double *amplitude_V, double *phase_rad);
void bench_lockin_sine(const float *samples_V, size_t blocks, size_t n, double rate_Hz, double frequency_Hz,
					   double *amplitude_V, double *phase_rad);
float bench_read(const float *values, size_t n);

void bench_lockin(const float *samples_V, size_t blocks, size_t n, double rate_Hz, double frequency_Hz,
				  double *amplitude_V, double *phase_rad)
{
	double offset_V;
	for (size_t b = 0; b < blocks; b++)
		(void)tactus_lockin_block_f32(samples_V + b * n, n, rate_Hz, frequency_Hz, &amplitude_V[b], &phase_rad[b],
									  &offset_V);
}

/* A sine and a cosine per sample, for whole numbers of periods. */
void bench_lockin_sine(const float *samples_V, size_t blocks, size_t n, double rate_Hz, double frequency_Hz,
					   double *amplitude_V, double *phase_rad)
{
	for (size_t b = 0; b < blocks; b++) {
		double in_phase = 0, quadrature = 0;
		for (size_t i = 0; i < n; i++) {
			double angle = 2 * M_PI * frequency_Hz * (double)i / rate_Hz;
			in_phase += (double)samples_V[b * n + i] * cos(angle);
			quadrature += (double)samples_V[b * n + i] * sin(angle);
		}
		amplitude_V[b] = 2 * hypot(in_phase, quadrature) / (double)n;
		phase_rad[b] = atan2(-quadrature, in_phase);
	}
}

/* A sum over 32-byte vectors, eight at a time: bound by memory, as in STREAM; n is a multiple of 64. */
float bench_read(const float *values, size_t n)
{
	typedef float vector __attribute__((vector_size(32)));
	const vector *in = (const vector *)(const void *)values;
	vector sum[8] = {{0}};
	for (size_t i = 0; i < n / 8; i += 8)
		for (size_t k = 0; k < 8; k++)
			sum[k] += in[i + k];
	float total = 0;
	for (size_t k = 0; k < 8; k++)
		for (size_t lane = 0; lane < 8; lane++)
			total += sum[k][lane];
	return total;
}

/* The network fit alone, with given starts, as the peer gets it: no cross-validation, no tables. */
int bench_network(size_t n, const double *conductance_S, const double *capacitance_F, const double *force_N,
				  const double *starts, size_t start_count, double *parameters, double *costs);
void bench_network_starts(uint64_t seed, uint64_t stream, size_t starts, double *weights);

int bench_network(size_t n, const double *conductance_S, const double *capacitance_F, const double *force_N,
				  const double *starts, size_t start_count, double *parameters, double *costs)
{
	return tactus_fit_network(n, conductance_S, capacitance_F, force_N, starts, start_count, parameters, costs);
}

void bench_network_starts(uint64_t seed, uint64_t stream, size_t starts, double *weights)
{
	tactus_network_starts(seed, stream, starts, weights);
}

/* ---- Modbus on the loopback: a libmodbus server, and what bare libmodbus calls read from it ---- */

int bench_modbus_listen(int *port);
void bench_modbus_serve(int listener);
int bench_modbus_read(int port, const int *addresses, const int *counts, size_t requests, size_t scans);

/* The listener, and its port. */
int bench_modbus_listen(int *port)
{
	struct sockaddr_in address = {0};
	socklen_t size = sizeof(address);
	modbus_t *context = modbus_new_tcp("127.0.0.1", 0);
	const int listener = modbus_tcp_listen(context, 4);
	getsockname(listener, (struct sockaddr *)&address, &size);
	*port = ntohs(address.sin_port);
	modbus_free(context);
	return listener;
}

/* Answers one client after the other, for ever. */
void bench_modbus_serve(int listener)
{
	uint8_t request[MODBUS_TCP_MAX_ADU_LENGTH];
	modbus_t *context = modbus_new_tcp("127.0.0.1", 0);
	modbus_mapping_t *tables = modbus_mapping_new(0, 0, 512, 0);
	while (modbus_tcp_accept(context, &listener) >= 0) {
		int n;
		while ((n = modbus_receive(context, request)) >= 0)
			modbus_reply(context, request, n, tables);
		modbus_close(context);
	}
}

/* The same requests again and again: 0, or −1 if one failed. */
int bench_modbus_read(int port, const int *addresses, const int *counts, size_t requests, size_t scans)
{
	uint16_t words[MODBUS_MAX_READ_REGISTERS];
	modbus_t *context = modbus_new_tcp("127.0.0.1", port);
	int failed = modbus_connect(context);
	modbus_set_slave(context, 1);
	for (size_t i = 0; i < scans * requests && failed == 0; i++)
		failed = modbus_read_registers(context, addresses[i % requests], counts[i % requests], words) < 0 ? -1 : 0;
	modbus_close(context);
	modbus_free(context);
	return failed;
}
