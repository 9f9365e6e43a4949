% LFToolbox in Octave: gantry folders, ESLF and MAT files.  Its shift-sum filter needs
% griddedInterpolant, which Octave does not have.
args = argv ();
[toolbox, gantry, eslf, stored, side, out] = args{end-5:end};
side = str2double (side);
pkg load image
addpath (genpath (toolbox));
made.gantry = LFReadGantryArray (gantry, struct ('STSize', [side, side]));
made.eslf = LFReadESLF (eslf, [side, side], false);
held = load (stored);
made.stored = held.LF;
save ('-v7', out, '-struct', 'made');
