% Mean powers of each row of an exported run, W; absorbed is negative.  octave row_powers.m run.mat
run_file = argv(){end};
S = load(run_file);  R = S.rigSignals;  H = S.heaveSignals;  P = S.hbmSignals;
if isfield(P, "expDriveInP"), dc = P.expDriveInP; else, dc = P.heaveDriveInP; end
measured = R.phase == 4 & R.row >= 0;
for row = unique(R.row(measured))'
  here = measured & R.row == row;
  here = here & R.attempt == max(R.attempt(here));
  v = H.heaveEncVel_m_s(here);
  lcb = H.heaveForceLCB_N(here);  trs = H.heaveForceTRS_N(here);
  mechanical = mean((lcb - mean(lcb)) .* v);
  shaft = mean((trs - mean(trs)) .* v);
  printf("%d %.15g %.15g %.15g %.15g\n", row, mechanical, shaft, ...
         -mean(P.heaveDriveOutSumP(here)), mean(dc(here)));
end
