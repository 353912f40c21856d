// Enough of an Arduino to run a sketch on this machine: its serial port is a pseudo-terminal whose name is printed, its
// clock goes a millisecond each time it is asked (with REAL_CLOCK in the environment as fast as any), and its inputs read
// what two sensors under a swelling load would give.
#pragma once
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <pty.h>
#include <string>
#include <termios.h>
#include <unistd.h>

enum { A0, A1 };

inline unsigned long clock_ms = 0;

inline unsigned long millis()
{
	static const bool real = std::getenv("REAL_CLOCK") != nullptr;
	if (real)
		usleep(1000);
	return clock_ms++;
}

// The load is 10 N (1 - cos): the counts of input 0 are 20 per newton, of input 1 30 per newton, from 10 on.
inline int analogRead(int input)
{
	const double force_N = 10 * (1 - std::cos(1e-3 * static_cast<double>(clock_ms)));
	return 10 + static_cast<int>((input == A0 ? 20 : 30) * force_N);
}

struct HostSerial {
	int master = -1;

	void begin(long)
	{
		int slave = -1;
		char name[64];
		termios raw{};
		cfmakeraw(&raw);
		if (openpty(&master, &slave, name, &raw, nullptr) < 0)
			std::exit(1);
		std::printf("%s\n", name); // the other end stays open, so that nothing is lost before somebody listens
		std::fflush(stdout);
	}
	explicit operator bool() const { return master >= 0; }

	void write_text(const std::string &text) const
	{
		if (::write(master, text.data(), text.size()) < 0)
			std::exit(0);
	}
	void print(const char *text) const { write_text(text); }
	void print(char c) const { write_text({c}); }
	void print(int value) const { write_text(std::to_string(value)); }
	void print(unsigned long value) const { write_text(std::to_string(value)); }
	void print(double value, int digits) const
	{
		char text[64];
		std::snprintf(text, sizeof text, "%.*f", digits, value);
		write_text(text);
	}
	template <typename... T> void println(T... what) const
	{
		print(what...);
		write_text("\r\n");
	}
};
inline HostSerial Serial;

void setup();
void loop();

int main()
{
	setup();
	for (;;)
		loop();
}
