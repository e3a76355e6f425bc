% The eigenfunctions of a mesh in Octave or MATLAB: chladni computes them, a MAT file brings them here.
%
%   octave-cli modes.m                      with chladni on the path, or CHLADNI=/path/to/chladni
program = getenv('CHLADNI');
if isempty(program), program = 'chladni'; end
run = @(line) assert(system([program ' ' line]) == 0, ['failed: ' line]);

run('sample starfish -n 3000 -o starfish.ply');
run('solve starfish.ply -n 60 --method hsim --tolerance 1e-8 --precision f64 -q -o starfish.mat');
basis = load('starfish.mat');

% Orthonormal in the mass: Phi' M Phi = I.
M = spdiags(basis.mass, 0, numel(basis.mass), numel(basis.mass));
defect = norm(basis.functions' * M * basis.functions - eye(numel(basis.eigenvalues)), 'fro');
fprintf('%d vertices, %d modes, defect %.1e\n', size(basis.functions), defect);
assert(defect < 1e-8);

% Heat kernel signatures at eight times: a row for each vertex.
times = logspace(log10(4 * log(10) / basis.eigenvalues(end)), log10(4 * log(10) / basis.eigenvalues(2)), 8);
hks = basis.functions .^ 2 * exp(-basis.eigenvalues * times);
[~, tip] = max(hks(:, 4));
% Rows are of the vertices that were kept; vertex_map has for each vertex of the file its row, from 1, or 0.
fprintf('hottest at vertex %d, (%.2f %.2f %.2f)\n', find(basis.vertex_map == tip, 1), basis.vertices(tip, :));
% trisurf(basis.faces, basis.vertices(:, 1), basis.vertices(:, 2), basis.vertices(:, 3), hks(:, 4)); axis equal
