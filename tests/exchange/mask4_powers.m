% Powers of rows by counting samples at 200 Hz, as the scripts of the MASK4 test find them.
%   octave mask4_powers.m FILE T_rep dT dead n_reps   (s; n_reps 0: irregular, to the row's end)
% A line a row: kp ki spring dc ac lcb trs stator slew, then powers without the window's last sample.
arguments = argv();
S = load(arguments{1});
[T_rep, dT, dead, n_reps] = num2cell(cellfun(@str2double, arguments(2:5))){:};
rate = 200;
kp = S.expParamSignals.heaveKpUsed;
first = find(S.expCtrl.runCounter == 1, 1) + 120 * rate;
marked = find(kp == -999, 1);
count = (marked / rate - first / rate) / dT;
t = S.magSpringSignals.time;
P = S.hbmSignals;
if isfield(P, "expDriveInP"), dc = P.expDriveInP; else, dc = P.heaveDriveInP; end
dc = interp1(P.time, dc, t);
ac = -interp1(P.time, P.heaveDriveOutSumP, t);
H = S.heaveSignals;
absorbed = @(force, v) mean((force - mean(force)) .* v);
for k = 1:count
  from = first + dead * rate + (k - 1) * dT * rate;
  if n_reps > 0, to = from + n_reps * T_rep * rate; else, to = first + k * dT * rate - 1; end
  at = (from:to)';
  v = H.heaveEncVel_m_s(at);
  M = S.magSpringSignals;
  row = [round(mean(kp(at))), round(mean(S.expParamSignals.heaveKiUsed(at))), ...
         mean(S.magSpringSetpointSignals.targetSpring_N_m(at)), mean(dc(at)), mean(ac(at)), ...
         absorbed(H.heaveForceLCB_N(at), v), absorbed(H.heaveForceTRS_N(at), v), ...
         min(M.forceStatorA_N(at) + M.forceStatorB_N(at)), mean(M.forceSlew_N(at))];
  if n_reps > 0, at(end) = []; end
  v = H.heaveEncVel_m_s(at);
  row = [row, mean(dc(at)), mean(ac(at)), absorbed(H.heaveForceLCB_N(at), v), ...
         absorbed(H.heaveForceTRS_N(at), v)];
  printf("%.15g ", row);  printf("\n");
end
