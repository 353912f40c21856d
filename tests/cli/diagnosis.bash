# What the tests of the diagnosis share.

verdicts="cause-found nothing-wrong unexplained ambiguous stale-calibration bad-recording"

# What must hold of every result on standard input, whatever the recording: the contract's keys, in its order.
contract() {
	jq -e --arg verdicts "$verdicts" '
		def number_or_null: type == "number" or . == null;
		def interval: type == "array" and length == 2 and all(.[]; number_or_null);
		(keys_unsorted == ["recordings","domain","verdict","summary","problems","series","extended_model"]) and
		(.verdict as $v | $verdicts | split(" ") | index($v) != null) and (.summary | length > 0) and
		(all(.problems[]; keys_unsorted == ["kind","text","rows"])) and
		(all(.series[];
			(keys_unsorted == ["channel","samples","verdict","base","wrong","causes","structure_remains","unexplained",
				"not_testable","gain","next_experiment","candidates","every","force_rmse_N","moved"]) and
			(all(.base[]; keys_unsorted == ["output","unit","rmse","refit_rmse","noise_floor"])) and
			(all(.wrong[]; keys_unsorted == ["covariate","explained","p_value","text"])) and
			(all(.causes[];
				(keys_unsorted == ["effect","summary","source","parameters","evidence","rivals"]) and
				(all(.parameters[]; keys_unsorted == ["name","value","unit","standard_error"])) and
				(.evidence | keys_unsorted == ["delta_bic","held_out_gain","held_out_gain_ci95","p_value"]) and
				(.evidence.held_out_gain_ci95 | interval) and
				(all(.rivals[]; keys_unsorted == ["effect","delta_bic","testable"])))) and
			(.structure_remains | type == "boolean") and
			(all(.unexplained[]; keys_unsorted == ["covariate","explained","text"])) and
			(all(.not_testable[]; keys_unsorted == ["effect","why"])) and
			(.gain == null or (.gain | keys_unsorted == ["rmse_before","rmse_after","unit","reduction","ci95",
				"of_explainable","force_rmse_before_N","force_rmse_after_N"] and (.ci95 | interval))) and
			(.next_experiment == null or (.next_experiment | keys_unsorted == ["separates","command","text"])) and
			(all(.candidates[]; keys_unsorted == ["effect","delta_bic","why"]))))' >/dev/null
}

# linear_model G0 G1 NOISE: G = g0 + g1 F of channel 1, without effects.
linear_model() {
	cat <<-EOM
		kind = "model"
		format = 1
		domain = "sensor"
		form = "forward"
		[output.conductance_S]
		[[channel]]
		channel = 1
		input_range = [0, 200]
		base = { g0 = $1, g1 = $2 }
		[channel.reading.conductance_S]
		residual_std = $3
	EOM
}

# Rows of a sensor recording on standard output, made by an awk body that may set t, f (N), g (S) and x.
made() {
	awk -v n="${2:-600}" "BEGIN {
		print \"time_s,sequence,channel,force_N,conductance_S,extra\"
		srand(1)
		for (i = 0; i < n; i++) {
			t = i / 10; f = i % 200 < 100 ? i % 200 : 200 - i % 200; x = rand() - 0.5
			g = 1e-6 + 4e-7 * f + 2e-8 * (rand() + rand() + rand() - 1.5)
			$1
			printf \"%.10g,%d,1,%s,%s,%s\n\", t, i, f, g, x
		}
	}"
}

# computed NAMES VALUES <STATEMENTS: a recording of what numpy computes.
computed() {
	{
		echo 'import numpy as np'
		cat
		echo "np.savetxt('/dev/stdout', np.column_stack([$2]), '%.8g', ',', header='$1', comments='')"
	} | "$PYTHON" -
}
