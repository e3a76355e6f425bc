% Eigenpairs of a mesh in Octave or MATLAB, by the command line: chladni solve writes what load reads.
%
%   octave modes.m MESH [PAIRS]
arguments = argv();
mesh = arguments{1};
pairs = 20;
if numel(arguments) > 1, pairs = str2double(arguments{2}); end
file = [tempname() '.mat'];
command = sprintf('chladni solve "%s" --method hsim -n %d --tolerance 1e-8 -q -o "%s"', mesh, pairs, file);
[status, output] = system(command);
if status ~= 0, error('%s', output); end
basis = load(file);
delete(file);
disp(fieldnames(basis)');
disp(basis.eigenvalues(:)');
