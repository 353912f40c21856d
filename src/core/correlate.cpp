/* Cross-correlation of two signals through FFTs (Eigen's), behind a C interface; no exception leaves it. */
#include <complex>
#include <exception>
#include <vector>

#include <unsupported/Eigen/FFT>

#include "core/core.h"
#include "core/join.h"

namespace
{
std::vector<std::complex<double>> transform(Eigen::FFT<double> &fft, const double *values, size_t n, size_t length)
{
	std::vector<double> padded(length, 0.0);
	std::copy(values, values + n, padded.begin());
	std::vector<std::complex<double>> spectrum;
	fft.fwd(spectrum, padded);
	return spectrum;
}
} // namespace

int tactus_correlate(const double *a, size_t na, const double *b, size_t nb, double *out)
{
	try {
		size_t length = 2;
		while (length < na + nb)
			length *= 2;
		Eigen::FFT<double> fft;
		auto spectrum = transform(fft, a, na, length);
		const auto other = transform(fft, b, nb, length);
		for (size_t i = 0; i < spectrum.size(); i++)
			spectrum[i] *= std::conj(other[i]);
		std::vector<double> product;
		fft.inv(product, spectrum, static_cast<Eigen::Index>(length));
		for (size_t i = 0; i < na + nb - 1; i++) /* lag k stands at k modulo the length */
			out[i] = product[(i + length - (nb - 1)) % length];
		return TACTUS_OK;
	} catch (const std::exception &) {
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	}
}
