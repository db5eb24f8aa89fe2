% Impedances from multisine rows, as the system identification of the MASK4 test finds them.
%   octave mask4_impedance.m FILE T_nom N_per ssTime COUNTER...   (s; the realisations of one model)
% A line a frequency from 0.2 to 1 Hz: f, then real and imaginary part of 1/Y with the force by
% current, command, shaft torque, column load cell.
arguments = argv();
S = load(arguments{1});
numbers = cellfun(@str2double, arguments(2:end));
[T, periods, wait] = num2cell(numbers(1:3)){:};
rate = 200;
n = periods * T * rate;
H = S.heaveSignals;
forces = {H.heaveForceI_N, S.refSignals.heaveRefRaw_N, H.heaveForceTRS_N, H.heaveForceLCB_N};
kept = 1:periods:floor(n / 2) + 1;  % lines of one period
f = rate * (kept' - 1) / n;
product = power = zeros(numel(f), numel(forces));
for counter = numbers(4:end)'
  at = find(S.expCtrl.runCounter == counter, 1) + wait * rate + (0:n - 1)';
  x = fft(H.heaveEncPos_m(at))(kept);
  for i = 1:numel(forces)
    F = fft(forces{i}(at))(kept);
    product(:, i) += conj(F) .* x;  % least squares of x = Y F over the realisations
    power(:, i) += abs(F) .^ 2;
  end
end
Z = power ./ (product .* (2i * pi * f));
band = f > 0.2 - 1e-9 & f < 1 + 1e-9;
for k = find(band)'
  printf("%.15g ", f(k), [real(Z(k, :)); imag(Z(k, :))]);  printf("\n");
end
