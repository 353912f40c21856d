/* What the estimator's parts share: readings one by one (estimate.c) and blocks of a table (estimate_block.c). */
#ifndef TACTUS_ESTIMATE_H
#define TACTUS_ESTIMATE_H

#include "model/columns.h"
#include "model/inverse.h"
#include "model/model.h"

#ifdef __cplusplus
extern "C" {
#endif

enum tactus_row_mode { TACTUS_ROW_ANY, TACTUS_ROW_DC, TACTUS_ROW_AC, TACTUS_ROW_MODES };

typedef struct {
	tactus_inverse_reading reading; /* covariates and time as recorded; neighbours are filled in */
	double sequence;                /* NaN: not known */
	int channel;
	enum tactus_row_mode mode;
	unsigned quality; /* of the reading */
} tactus_estimator_row;

typedef struct {
	const tactus_model_channel_data *data;
	tactus_inverse *inverse;         /* NULL in an estimator of another form */
	double offset_s;                 /* the reading belongs to a force so long before */
	double latest[TACTUS_ROW_MODES]; /* force of the last reading of that mode, for the neighbours; NaN: none yet */
	/* What came of the scan before this row: the other mode's reading and its force. */
	double sequence;
	double pair[TACTUS_OUTPUTS_MAX], pair_std[TACTUS_OUTPUTS_MAX];
	unsigned pair_quality;
	tactus_inverse_result half;
} tactus_estimator_channel;

struct tactus_estimator {
	tactus_model *model;
	tactus_columns columns; /* the domain's signals; bound to a table while a block is worked on */
	enum tactus_row_mode output_mode[TACTUS_OUTPUTS_MAX];
	bool needed[TACTUS_SIGNALS_MAX]; /* an active effect asks for this covariate */
	bool coupled, moved;             /* some channel has crosstalk; some channel has a time offset */
	bool halves;                     /* two readings, in rows of different modes */
	tactus_estimator_channel *channels;
	size_t last; /* channel of the row before */
	/* How the scan before ended: the next is complete when it has come so far. channel NaN: there was none. */
	double end_channel;
	enum tactus_row_mode end_mode;
	/* Room for a block. */
	size_t capacity;
	unsigned *quality;
	tactus_text *text;
	tactus_estimator_row *scan;
	tactus_force *forces;
	size_t scan_capacity;
};

/* One row, in the order of time; neighbours are taken as their last forces are. */
tactus_force tactus_estimator_row_force(tactus_estimator *estimator, const tactus_estimator_row *row);
/* The rows of one scan: coupled channels are solved jointly. */
void tactus_estimator_scan(tactus_estimator *estimator, const tactus_estimator_row *rows, size_t n,
						   tactus_force *forces);
/* Force and its standard uncertainty from conductance and capacitance with an estimator's parameters. */
double tactus_estimator_evaluate(enum tactus_form form, const tactus_model_channel_data *data, const double *reading,
								 const double *reading_std, double *std);

#ifdef __cplusplus
}
#endif

#endif
