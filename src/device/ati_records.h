/* ATI Net F/T: the bytes of its raw data transfer (UDP) and what its web page says of its units. */
#ifndef TACTUS_ATI_RECORDS_H
#define TACTUS_ATI_RECORDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { TACTUS_ATI_REQUEST = 8, TACTUS_ATI_RECORD = 36 };
enum tactus_ati_command { TACTUS_ATI_STOP = 0, TACTUS_ATI_REALTIME = 2 };

#define TACTUS_ATI_MONITOR 0x00010000u   /* a monitor condition is latched: a warning */
#define TACTUS_ATI_SATURATED 0x00020000u /* the transducer is at its end */
#define TACTUS_ATI_ERROR 0x80000000u     /* set beside any of the others */

typedef struct {
	uint32_t sequence, sample, status;
	int32_t counts[6]; /* Fx Fy Fz Tx Ty Tz */
} tactus_ati_record;

typedef struct {
	double counts_per_N, counts_per_Nm;
} tactus_ati_scale;

void tactus_ati_request(enum tactus_ati_command command, uint32_t count, uint8_t bytes[TACTUS_ATI_REQUEST]);
/* False if the datagram is no record. */
bool tactus_ati_parse(const uint8_t *bytes, size_t n, tactus_ati_record *record);
/* Counts per unit and units from netftapi2.xml. TACTUS_ERR_DEVICE that says what is missing or unknown. */
int tactus_ati_read_scale(const char *xml, tactus_ati_scale *scale);

#endif
