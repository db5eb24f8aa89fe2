% Spring rates by stator position, as the mapping of the MASK4 test finds them.
%   octave mask4_spring.m FILE
% A line a position: %, turns, inches, N m/rad, N/m, 98th percentile of the stator force in N.
S = load(argv(){1});
M = S.magSpringSignals;
average = ones(20, 1) / 20;  % forwards and backwards, without the ends
smooth = @(x) conv(conv(x, average, "valid"), average, "valid");
for k = 1:max(S.expCtrl.runCounter)
  at = find(S.expCtrl.runCounter == k);
  at = at(diff(M.nanoRatePos_rev(at)) < 0.01);  % the stator stands
  theta = smooth(M.rotorAngleEQN437_rad(at) - M.slewSpAngle_deg(at) * pi / 180);
  torque = -smooth(M.forceSlew_N(at)) * 10 * 0.0254;
  near = abs(theta - 542.5 * pi / 180) < pi / 4 - 0.1;
  slope = polyfit(theta(near), torque(near), 1)(1);
  printf("%.15g ", median(M.nanoRatePos_percent(at)), median(M.nanoRatePos_rev(at)), ...
         median(M.nanoRatePos_inch(at)), slope, slope / 0.33047 ^ 2, ...
         prctile(M.forceStatorA_N(at) + M.forceStatorB_N(at), 98));
  printf("\n");
end
