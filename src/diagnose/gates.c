/* Gates (being written). */
#include "diagnose/gates.h"
int tactus_gates(const tactus_table *recording, const tactus_series *series, size_t count, bool *const *const *use,
				 tactus_gate_problems *problems)
{
	(void)recording; (void)series; (void)count; (void)use; (void)problems;
	return 0;
}
void tactus_gates_free(tactus_gate_problems *problems)
{
	(void)problems;
}
