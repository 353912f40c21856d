/*
 * The cheapest bench: two force sensors on an Arduino, read by `tactus scan serial:/dev/ttyACM0`.
 *
 * Each sensor lies between a source of -DRIVE volts and the inverting input of an op-amp with RG ohms to its output; the
 * outputs are on A0 and A1. The output is DRIVE * RG * G volts, of which the ADC makes 1023 / REFERENCE counts each:
 * G = counts / (1023 / REFERENCE * DRIVE * RG). The header line says so, and tactus does the rest. Without op-amps, a
 * divider will do to begin with: print the counts as they are and calibrate those (`tactus fit --output adc_count`).
 * It was run by tests on a computer, not tried on a board yet.
 */
const float REFERENCE = 5.0;     /* volts of the ADC's full scale */
const float DRIVE = 1.0;         /* volts across the sensor */
const float RG = 10000.0;        /* ohms */
const unsigned long PERIOD = 20; /* milliseconds between lines */

unsigned long count = 0;

void setup()
{
	Serial.begin(115200);
	while (!Serial) /* boards with USB of their own: until somebody listens */
		;
	const float counts_per_siemens = 1023.0 / REFERENCE * DRIVE * RG;
	Serial.print("sequence,time_s/1000,conductance_S@1/");
	Serial.print(counts_per_siemens, 1);
	Serial.print(",conductance_S@2/");
	Serial.println(counts_per_siemens, 1);
}

void loop()
{
	static unsigned long due = 0;
	if (millis() < due)
		return;
	due += PERIOD;
	/* the first conversion after the multiplexer switched still holds the other sensor's charge */
	analogRead(A0);
	const int first = analogRead(A0);
	analogRead(A1);
	const int second = analogRead(A1);
	Serial.print(count++);
	Serial.print(',');
	Serial.print(millis());
	Serial.print(',');
	Serial.print(first);
	Serial.print(',');
	Serial.println(second);
}
