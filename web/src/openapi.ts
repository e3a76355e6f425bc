// Made from openapi/openapi.json by tests/openapi/run --write; not to be edited.

export interface paths {
    "/docs": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Shows the reference of the API
         * @description A page made from the OpenAPI document: every operation, to be searched and tried. It loads nothing from elsewhere.
         *     `/docs/plain` is the same to read, without a script; the manual is at `/docs/guide/`.
         */
        get: operations["docs"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/healthz": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Tells that the process answers
         * @description For restarts: it stays 200 while the server drains or its disk is full. See `/readyz` for that.
         */
        get: operations["health"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/metrics": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Gives the metrics
         * @description In the Prometheus text format, in base units, with the prefix `chladni_`.
         */
        get: operations["metrics"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/openapi.json": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Gives the OpenAPI document
         * @description OpenAPI 3.1, as JSON.
         */
        get: operations["openapi"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/problems": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Lists every kind of problem
         * @description A page with the kinds of problems, their statuses and what to do about them.
         */
        get: operations["problems"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/problems/{kind}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Explains a kind of problem
         * @description What the `type` of a problem points to.
         */
        get: operations["problem"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/readyz": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Tells whether the server takes work
         * @description Where it does not, the problem's `reasons` tell a full disk (`storage-full`), databases that were removed or
         *     replaced (`storage-replaced`), a store that cannot be written for another cause (`storage-unavailable`: a database
         *     that does not answer, where one is shared), an object store that does not answer (`content-unavailable`), dead
         *     workers (`workers-dead`) and a server that shuts down (`draining`) apart.
         */
        get: operations["ready"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/bases": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Lists bases
         * @description Newest first, without eigenvalues and certificates.
         */
        get: operations["listBases"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/bases/{id}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Shows a basis
         * @description With its eigenvalues (1/length² of the mesh) and its certificate: per pair the relative residual ‖Sx − θMx‖ / ‖Sx‖
         *     and a bound within which an exact eigenvalue lies, and the defect of orthonormality.
         */
        get: operations["showBasis"];
        put?: never;
        post?: never;
        /**
         * Deletes a basis
         * @description Its content goes with it. An equal job that is submitted later computes it anew. Refused while a job needs it that
         *     waits or runs.
         */
        delete: operations["deleteBasis"];
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/bases/{id}/compress": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Compresses functions
         * @description The coefficients of functions, coordinates above all, in the first modes of the basis, rounded and packed (Karni and
         *     Gotsman 2000). Whoever has the basis puts them together again with `decompress`; `basis_bytes` says what that is,
         *     and the rates are told without and with it.
         *
         *     JSON answers with rate and distortion; `Accept: application/octet-stream` with the bytes, and the distortion in
         *     `Chladni-Relative-Error`. A raw body is the functions, as for `filter`; the rest of the request stands in the query
         *     then.
         */
        post: operations["compress"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/bases/{id}/content": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Gets a basis as a file
         * @description The eigenfunctions of a compact basis are the columns of `U φ̄`, with the sparse `U` (n × d, f32) and the dense `φ̄`
         *     (d × m, f64); those of a dense basis are the columns of `functions` (n × m, f32 or f64).
         *
         *     As NPZ (the default): the members `format`, `shape`, `data`, `indices`, `indptr` of U in CSR form and
         *     `coefficients`, or `functions`, beside `eigenvalues`, the mass, `residuals`, `bounds`, `certificate` and `metadata`;
         *     it opens with `numpy.load` (everything) and `scipy.sparse.load_npz` (U). As safetensors and as a ZIP archive of
         *     MatrixMarket files: the same under the same names (the rows of safetensors' `functions` are the eigenfunctions).
         *     Dense bases are streamed; their MatrixMarket form has no ranges.
         *
         *     A field basis comes as NPZ alone: `format`, `shape`, `data`, `indices`, `indptr` of the locally supported columns in
         *     BSR form, a block row for each face, for `scipy.sparse.load_npz`; `dense` columns for harmonic fields; `stiffness`
         *     and `mass` of the space in CSR form; `ritz_values` and `ritz_vectors`; `samples`, `area`, `kind` and `metadata`.
         */
        get: operations["getBasisContent"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/bases/{id}/decompress": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Puts compressed functions together again
         * @description The body is what `compress` gave for the same basis. The answer is the functions, a row for each vertex: raw by
         *     default, as JSON, or, of three functions, as `model/ply`, the mesh with them as its coordinates.
         */
        post: operations["decompress"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/bases/{id}/design": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Designs a field
         * @description The field of least energy `w₁ · harmonic + w₂ · biharmonic` in the space that deviates little from strokes and an
         *     alignment, by their weights, and meets hard constraints exactly (Schur complement). Strokes and constraints name a
         *     face, or a point whose nearest face is meant, and a direction in ℝ³ or in the frame of the face
         *     (`GET /meshes/{id}/frames`); a stroke may be a line of points as well. Everything is sent again with each request:
         *     what does not change is kept by the server, a moved stroke costs one small solve. Send requests over one kept
         *     connection.
         *
         *     Where the memory that is kept for fields (`--cache-bytes`) holds two sparse factors of the surface the field is the
         *     one of least energy among all fields of the surface; energies and residuals are its own, coefficients are those of
         *     the field of the space that is nearest to it, and `error` is how far that is. On larger surfaces, and with
         *     `"space": "basis"`, it is a field of the space of the basis, which stands for that one: with `error` the answer says
         *     how far it is from it, with `refine` that one is the answer, to a tolerance. `space` in the answer says which of
         *     both it is.
         *
         *     With `Accept: application/octet-stream` the answer is the lifted field as little-endian f32, f16 or octahedral
         *     directions (`encoding`), face after face, with its shape in `Chladni-Rows` and `Chladni-Columns`, the energies in
         *     `Chladni-Energies` (harmonic, biharmonic, alignment), the largest residual of a constraint in `Chladni-Residual`,
         *     `space` in `Chladni-Space`, where the request has `error` that in `Chladni-Error`, and with `exact` singularities in
         *     `Chladni-Matching` how many pairs of faces `matching` of the JSON answer has: where that is not 0, the numbers alone
         *     do not tell where the field is singular. `faces` restricts it to
         *     some: 3,000 faces of a sample are 36,000 bytes, half of that in f16, a third as octahedral directions, whatever the
         *     surface. Which faces a sample has is in `field.faces` of a JSON answer, and stays the same.
         */
        post: operations["designField"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/bases/{id}/designs": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Saves a design
         * @description Designs a field and keeps it, with the request that made it: other requests name it by its id as they do uploads,
         *     and its numbers can be fetched in every form. It is on the mesh of the basis, and is deleted with either.
         */
        post: operations["saveDesign"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/bases/{id}/distances": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Computes distances
         * @description Diffusion, biharmonic, commute-time and geodesic distances, from one or many sources to all vertices or between
         *     pairs. A table with a row for each vertex (or pair) and a column for each source and, within a source, each time;
         *     with `nearest`, for each time.
         *
         *     Geodesic distances by `heat` and `exact` ones are computed on the mesh of the basis; what they prepare of it is kept
         *     for further requests. An infinite distance is `null` in JSON. `Chladni-Slope-Error` tells how far those by `heat`
         *     may be off: by how much their slope, which is one, differs from one, on average over the surface or along paths to
         *     the sources. They are off by about this share of themselves or less, by a quarter of it as a rule.
         *
         *     JSON, or raw numbers: with `Content-Type: application/octet-stream` the body is little-endian u32, sources or with
         *     `pairs=true` the vertices of pairs, and the rest of the request stands in the query. The answer is of the same kind
         *     unless `Accept` says otherwise.
         */
        post: operations["distances"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/bases/{id}/eigenfields": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Gets approximate eigenfields
         * @description The lowest fields of the Laplacian of the basis, restricted to its space, of unit norm on the surface of unit area.
         *     Their eigenvalues, in `Chladni-Eigenvalues` (of up to 256 fields), are `eigenvalues` of the basis: exact ones lie
         *     below them, by about what `Chladni-Estimates` says, `certificate.estimates` of the basis, where all of the fields
         *     were judged. With `refine` they are corrected by multigrid among all fields of the
         *     surface, at most the lowest 256: the fields and their eigenvalues are then those of the surface, to a tolerance, and
         *     the estimates are those of what is left. By `Accept`:
         *     `application/x-npy` (the default), an array of fields × faces × numbers for `numpy.load`;
         *     `application/octet-stream`, the same little-endian f32 without a header.
         */
        get: operations["getEigenfields"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/bases/{id}/filter": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Filters functions by their spectrum
         * @description `x' = Φ F(Λ) ΦᵀM x + F∞ (x − ΦΦᵀM x)` (Vallet and Lévy 2008): each part of a function is multiplied by a factor that
         *     depends on its eigenvalue; detail that the basis does not hold is multiplied by F∞, not lost.
         *
         *     JSON, or raw numbers for speed: with `Content-Type: application/octet-stream` the body is little-endian values,
         *     vertex after vertex and, within a vertex, function after function, of the type `dtype`; the transfer function stands
         *     in the query. The answer is of the same kind unless `Accept` says otherwise; a raw one has its shape in
         *     `Chladni-Rows` and `Chladni-Columns`. A surface (`model/ply`, `model/obj`, `model/gltf-binary`) has the kept
         *     vertices in their order, which for points without faces is not that of the file, and the texture coordinates,
         *     normals and names that the mesh came with; normals turn with their faces.
         */
        post: operations["filter"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/bases/{id}/fur": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Combs fur
         * @description For each face a strand that leans along a vector field: its root (the barycentre of the face) and its tip relative
         *     to the root, six numbers in the units of the mesh, for a renderer. With `strands` so many, spread by area, that
         *     bend, fall and gather in tufts: three numbers for each of their points, the root first. JSON, or with
         *     `Accept: application/octet-stream` little-endian f32; with `Accept: image/png` a picture of them.
         */
        post: operations["combFur"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/bases/{id}/hatching": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Draws a hatching
         * @description Evenly spaced streamlines of a field (Jobard and Lefer 1997): of n-fields they follow any of the n directions, of
         *     tensor fields the eigendirections. As polylines on the surface, or with `Accept: image/svg+xml` or `image/png` as a
         *     drawing from a camera, without what the surface hides: with more lines where it is darker, crossed ones only in
         *     shadows, and with silhouettes.
         */
        post: operations["drawHatching"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/bases/{id}/maps": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Gets the maps between shapes
         * @description What a job of the kind `map_collection` found, in the form of `POST /v1/map-collections`: for each vertex of a
         *     target the vertex of the source that corresponds to it. Vertices are those of the uploaded files, for which their
         *     meshes have to be there, or with `numbering=kept` those of the meshes. The NPZ of `/content` has all of it as
         *     arrays, with the numbering of each file.
         */
        get: operations["getMaps"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/bases/{id}/modes": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Gets eigenfunctions on the vertices
         * @description Or the eigenvectors of a problem, a row for each of its rows.
         *
         *     By `Accept` or `format`: `application/x-npy` (the default), an n × k array in Fortran order for `numpy.load`;
         *     `application/octet-stream`, the same little-endian numbers, mode after mode, without a header; `model/ply`, the mesh
         *     with the values of one mode as colours, from blue over white at zero to red; it has the kept vertices in their
         *     order, which for points without faces is not that of the file. Numbers are f32 unless `dtype` says f64. Answers are
         *     streamed: nothing is computed before it is sent, and of a dense basis only the chunks of 32 columns that hold these
         *     modes are read.
         */
        get: operations["getModes"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/bases/{id}/project": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Projects functions onto a basis
         * @description `ΦᵀM x`: the coefficients of the nearest combinations of the first `pairs` eigenfunctions, a row for each of them,
         *     and how much they do not hold. JSON or raw numbers, as for `filter`; a raw answer is the coefficients, or with
         *     `reconstruct=true` the projected functions, and has the relative errors in `Chladni-Relative-Error`.
         */
        post: operations["project"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/bases/{id}/reconstruct": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Evaluates combinations of eigenfunctions
         * @description `Φ c` for a table of coefficients with a row for each eigenfunction: what `project` gives, changed or not. JSON or
         *     raw numbers, as for `filter`; the answer has a row for each vertex.
         */
        post: operations["reconstruct"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/bases/{id}/signatures": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Computes signatures of points
         * @description The heat kernel, the wave kernel or the global point signature, of chosen vertices or all: a row for each vertex.
         *
         *     JSON, or raw numbers: with `Content-Type: application/octet-stream` the body is little-endian u32 vertices, or empty
         *     for all, and the rest of the request stands in the query. The answer is of the same kind unless `Accept` says
         *     otherwise.
         */
        post: operations["signatures"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/bases/{id}/similar-points": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Finds points that are similar to one
         * @description Compares the signature of every vertex with that of one: heat kernels by their distance over all scales (Sun et al.
         *     2009), wave kernels by their relative differences (Aubry et al. 2011), global points by the Euclidean distance.
         *
         *     JSON gives the most similar points. A raw answer is the difference of every vertex; a raw body is the vertex as one
         *     little-endian u32, the rest of the request stands in the query then.
         */
        post: operations["similarPoints"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/bases/{id}/simulate": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Simulates an object in its vibration modes
         * @description For a basis of the kind `vibration_basis`. Every mode is a damped oscillator, `q̈ + (α + βλ) q̇ + λ q = f` (thesis,
         *     eq. 2.16), whose motion is evaluated exactly at whatever time is asked for: there are no steps.
         *
         *     With `Accept: application/octet-stream` displacements come as raw little-endian f32, frame after frame, vertex after
         *     vertex, x, y and z of each. With `sound` the answer is a WAV file: what a tap sounds like at a point, by Rayleigh's
         *     integral without delays; `Chladni-Peak` has the largest pressure in pascal, if the mesh is in metres and the
         *     material in SI units.
         */
        post: operations["simulate"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/bases/{id}/spectrum": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Computes the spectrum of an operator of a family
         * @description The lowest pairs of `(1 − t) S + t A + v V` in the space of a basis of the kind `operator_family` (thesis, section
         *     2.6): `S` is the Laplacian, `A` also follows how the normal turns, `V` is the curvature potential. Meant to be asked
         *     again and again while somebody moves a slider: 100 pairs in a space of 780 functions take some tens of milliseconds.
         *
         *     With `Accept: application/octet-stream` the answer is what `give` names, as raw little-endian f32, row after row,
         *     and the eigenvalues stand in `Chladni-Eigenvalues`; `Chladni-Covered` is `covered`.
         */
        post: operations["familySpectrum"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/bases/{id}/value-gradient": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Computes the gradient of eigenvalues
         * @description The derivatives of a weighted sum of eigenvalues by the positions of the vertices: a row of three numbers for each
         *     vertex, in 1/length³ of the mesh. With the derivatives of a loss by the eigenvalues as weights they are those of the
         *     loss, which is what backpropagation asks for.
         *
         *     The Laplacian is to be that of the triangles as they are (`laplace`, or `auto` where it chose that) or of a solid
         *     (`volume`), the mass `barycentric` or `consistent`. Eigenvalues that coincide have no derivatives of their own, but
         *     their sum has: give them equal weights. Of an approximate basis it is the derivative of its values in the space that
         *     it has.
         *
         *     In the numbering of the file, merged vertices share what the vertex has that was kept of them, dropped ones have
         *     zero, and what belongs to vertices that `subdivide` made goes to the ends of their edges, so that moving the file's
         *     vertices by a small `v` changes the sum by the inner product of `v` with the answer.
         *
         *     JSON, or raw numbers: with `Content-Type: application/octet-stream` the body is the weights as little-endian f64.
         *     The answer is of the same kind unless `Accept` says otherwise.
         */
        post: operations["valueGradient"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/bases/{id}/verification": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Judges a basis again
         * @description Nothing of a solver takes part: the operator or the elastic object is assembled anew, or the matrices of the problem
         *     are read again, residuals and inner products are summed from the functions as they are stored, and where the basis
         *     claims to be complete its eigenvalues are counted by another factorisation. The answer is a receipt, as
         *     `chladni verify --receipt` writes it. Of vibration modes its eigenvalues, bounds, distances and shifts are squared
         *     angular frequencies, in 1/time². Of bases of fields for design, families of operators and maps nothing is proven,
         *     and there is nothing to be judged.
         */
        post: operations["verifyBasis"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/basis-comparisons": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Compares two bases of one surface
         * @description Projects the functions of one on those of the other: Fourier coefficients, what is left out, and the principal
         *     angles between eigenspaces, eigenvalues that lie close together being taken as one. With `following`, which mode of
         *     one is which of the other, as in two frames of an animation whose eigenvalues cross.
         */
        post: operations["compareBases"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/fields": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Lists stored fields
         * @description Newest first, without the requests of designs.
         */
        get: operations["listFields"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/fields/{id}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Shows a stored field
         * @description Of a design with the request that made it, in the numbering in which it was sent.
         */
        get: operations["showField"];
        put?: never;
        post?: never;
        /**
         * Deletes a stored field
         * @description Requests that name it are refused from then on.
         */
        delete: operations["deleteField"];
        options?: never;
        head?: never;
        /**
         * Renames a stored field
         * @description The name is for people; the id stays.
         */
        patch: operations["renameField"];
        trace?: never;
    };
    "/v1/fields/{id}/content": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Gets the numbers of a stored field
         * @description By `Accept`: `application/x-npy` (the default), an array of faces × numbers for `numpy.load`;
         *     `application/octet-stream`, the same little-endian f32 without a header; JSON.
         */
        get: operations["getFieldContent"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/functional-maps": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Maps functions between two surfaces
         * @description A functional map (Ovsjanikov et al. 2012) from landmarks, descriptors or signatures, refined by ZoomOut (Melzi et
         *     al. 2019), with the correspondence of points that it makes: for vertices of the target, vertices of the source, and
         *     with `both_ways` the other way. With `carry` functions on the source are carried over, colours and texture
         *     coordinates among them. Both bases have to be of one operator and one condition at the boundary. Sizes decide how
         *     long it takes: a hundred pairs and two thousand samples are a matter of a second, matching all points of large
         *     meshes one of many.
         *
         *     JSON, or raw numbers: with `Content-Type: application/octet-stream` the body is pairs of little-endian u32, the
         *     landmarks, and the rest of the request stands in the query. A raw answer is the matrix, row after row, or with
         *     `points=true` the points (4294967295 where a vertex has none).
         */
        post: operations["functionalMap"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/job-estimates": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Estimates a job
         * @description Takes what `POST /v1/jobs` takes, checks it as that does, and does nothing.
         */
        post: operations["estimateJob"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/jobs": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Lists jobs
         * @description Newest first. Pages stay stable while new jobs arrive. Jobs that solve parts of others are listed with `parent`.
         */
        get: operations["listJobs"];
        put?: never;
        /**
         * Submits a job
         * @description Vertices and faces that parameters name, and functions among them, are those of the uploaded file, unless
         *     `numbering=kept`; the job shows them as the mesh numbers them.
         *
         *     The same mesh, kind and parameters are worked on once: where an equal job waits, runs or is done, that job is the
         *     answer. With an `Idempotency-Key` a request that is sent twice makes one job, whatever happened to the first answer.
         *     With `wait` the answer comes when the job has ended or the time is over, whichever is first, as from
         *     `GET /v1/jobs/{id}`.
         */
        post: operations["submitJob"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/jobs/{id}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Shows a job
         * @description With `wait`, a long poll: the answer comes when the job has ended or the time is over, whichever is first; with
         *     `If-None-Match` beside it, as soon as the job differs from what the tag names.
         */
        get: operations["showJob"];
        put?: never;
        post?: never;
        /**
         * Deletes a job
         * @description One that has ended: cancel it first where it waits or runs. Refused while its basis is stored, unless
         *     `cascade=true`.
         */
        delete: operations["deleteJob"];
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/jobs/{id}/cancel": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Cancels a job
         * @description A waiting job is canceled at once; a running one is asked to stop and does within a second. Cancelling twice is no
         *     error.
         */
        post: operations["cancelJob"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/jobs/{id}/events": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Streams the changes of a job
         * @description Server-sent events of the type `job`, each with the whole job as data and its revision as id: the present state
         *     first (not repeated where `Last-Event-ID` names it), then every change, until the job has ended. Progress comes at
         *     most ten times a second. A client that reconnects after the end is told by 204 to stop.
         */
        get: operations["watchJob"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/jobs/{id}/retry": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Retries a job
         * @description A failed or canceled job waits again, with all its attempts. Retrying a job that waits or runs changes nothing.
         */
        post: operations["retryJob"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/map-collections": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Maps all shapes of a collection to each other
         * @description Without landmarks: first maps follow from wave kernel signatures and the orientation of the surfaces, are refined by
         *     ZoomOut (Melzi et al. 2019), and made consistent by a latent basis that all shapes have in common (Huang et al.
         *     2020), so that pairs that fail by themselves follow those that agree. Each basis has to be of another surface, and
         *     all of one operator and one condition at the boundary. The answer has a map of points for each ordered pair. Shapes
         *     are taken to be nearly isometric: poses of one animal, say. For more than a few shapes there is the job
         *     `map_collection`, which does the same in the queue and keeps what it finds.
         */
        post: operations["mapCollection"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/meshes": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Lists meshes
         * @description Newest first. Pages stay stable while new meshes arrive.
         */
        get: operations["listMeshes"];
        put?: never;
        /**
         * Uploads a mesh
         * @description The body is the file itself, or `multipart/form-data` with the file in a part named `mesh` (and, optionally, parts
         *     `format`, `merge`, `surface`, `subdivide` and `name`). The format comes from `format`, from `Content-Type` or the
         *     file name, or, for general types such as `application/octet-stream`, from the first bytes. `Content-Encoding` may be
         *     gzip or zstd; a file that is gzip itself is unpacked as well.
         *
         *     Arrays come as NPZ (`numpy.savez`: `vertices`, n × 3; `faces`, f × k; `tetrahedra`, t × 4) or JSON
         *     (`{"vertices": [[x, y, z], …], "faces": [[0, 1, 2], …]}`), vertices counted from 0.
         *
         *     A file with tetrahedra is a solid: the mesh is then the surface of its tetrahedra, unless `surface=given`, the
         *     report has the member `solid`, and the vertices of the surface are the first of the solid, both in the order of the
         *     file.
         *
         *     A file without faces has points: bases are then computed from triangles around each of them, the report has
         *     `points: true`, and what needs a surface with faces is refused. Points at equal positions become one, unless
         *     `merge=never`, and points at which no triangle can be made are left out. The points are kept in the order of a curve
         *     through space: meshes that are answered (the content of the mesh, PLY of filtered functions and of modes) have them
         *     in this order, and `GET /v1/meshes/{id}/vertex-map` tells which they are.
         *
         *     Where repairs renumber vertices or faces, the report has the member `file`, and all other routes take and give the
         *     numbering of the file unless they are asked for `numbering=kept`; so two files with the same surface and other
         *     numbers are two meshes.
         *
         *     Texture coordinates, normals and the names of groups, objects and materials of an OBJ are kept, each corner's own,
         *     so that seams split no vertex; the report counts them in its member `attributes`, and whatever surface goes out has
         *     them. They are part of the mesh: with others it is another one.
         *
         *     The mesh is checked; repairs that lose nothing are done and listed in the report. The same content has the same id:
         *     sending it again answers 200 with what is stored, under the name that it has. The report of this answer is always
         *     that of the file that was sent; that of the first file with this mesh is the one that is kept.
         */
        post: operations["uploadMesh"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/meshes/{id}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Shows a mesh
         * @description With the report of the check that it went through.
         */
        get: operations["showMesh"];
        put?: never;
        post?: never;
        /**
         * Deletes a mesh
         * @description Refused while unfinished jobs or bases refer to it, unless `cascade=true`.
         */
        delete: operations["deleteMesh"];
        options?: never;
        head?: never;
        /**
         * Renames a mesh
         * @description The name is for people; the id stays.
         */
        patch: operations["renameMesh"];
        trace?: never;
    };
    "/v1/meshes/{id}/content": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Gets the content of a mesh
         * @description By `Accept` or `format`: PLY (the default; binary, little-endian), OBJ, binary glTF, or buffers for web clients
         *     (`application/vnd.chladni.mesh`): all little-endian and aligned to four bytes, the number of vertices n and of faces
         *     f as u32, then 3n positions as f32, then 3f vertex indices as u32. Of a surface far from the origin, as in
         *     geographic coordinates, single precision keeps little of the shape: PLY and OBJ hold double, and glTF positions from
         *     the middle, where its nodes are moved to.
         *
         *     Texture coordinates, normals and names that the file had come back in all of them but buffers.
         */
        get: operations["getMeshContent"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/meshes/{id}/distances": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Computes geodesic distances on a mesh
         * @description As the route of a basis, for geodesic distances by `heat` and `exact` ones: no basis is needed.
         */
        post: operations["meshDistances"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/meshes/{id}/face-map": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Gets the map of faces
         * @description For each face of the mesh the face of the uploaded file that it is or is a part of, in NPY as int32; with `of=file`,
         *     for each face of the file the first of the mesh, in JSON null and in NPY −1 where it was dropped. A polygon is one
         *     face of the file. The boundary of a solid has no faces in the file, and its own numbers stand for them.
         */
        get: operations["getFaceMap"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/meshes/{id}/fields": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Uploads a field
         * @description A table with a row for each face, which requests name by its id from then on, as `{"stored": id}`: a field to align
         *     a design to (`alignment.to`: three columns are vectors in ℝ³, or the numbers of tensors where the basis is of
         *     tensors; two are numbers in the frames of faces), weights of faces (`alignment.per_face`: one column), crosses
         *     (`field` of a parametrisation), a field for fur or a hatching.
         *
         *     JSON, or with `Content-Type: application/octet-stream` little-endian numbers, face after face. An equal field on the
         *     same mesh has the same id. It is deleted with its mesh.
         */
        post: operations["uploadField"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/meshes/{id}/frames": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Gets the frames of faces
         * @description For each face two orthonormal vectors in its plane, six numbers: x first, then y; their cross product is the normal.
         *     Numbers per face of fields refer to them: `a x + b y`. JSON, or with `Accept: application/octet-stream`
         *     little-endian f32.
         */
        get: operations["getFrames"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/meshes/{id}/hodge-decomposition": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Decomposes a vector field
         * @description The Hodge decomposition of a field that is given on the faces: a gradient, a co-gradient and a harmonic field,
         *     orthogonal to each other, by area, to rounding. Gradients are those of functions that are linear on faces,
         *     co-gradients those of functions on edges that are not conforming, turned by 90°. Both Laplacians are factored at the
         *     first request about a mesh, and kept.
         */
        post: operations["decomposeField"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/meshes/{id}/quads": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Parametrises a surface along a cross field
         * @description A cross field that runs along creases and boundaries, or one of a basis, or a table, is combed and cut open at its
         *     singular vertices, and integrated: coordinates whose gradients are nearest to its directions, and which go on across
         *     the cut by quarter turns and translations. With `integers` the lines of whole numbers meet there, so that they are
         *     the edges of quads, for a program that takes them out, such as libQEx. The order in which vertices are eliminated is
         *     found at the first request about a mesh, and kept.
         */
        post: operations["parametriseQuads"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/meshes/{id}/surface": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Writes a mesh whose vertices have moved
         * @description The faces of the mesh with other positions (a mode that swings, a simulation, whatever a client computes), with all
         *     else that its file had: texture coordinates, names of groups, objects and materials, and normals, which turn with
         *     their faces. By `Accept` or `format`: PLY (the default), OBJ or binary glTF.
         *
         *     The body is a JSON table of three columns with a row for each vertex, or, with
         *     `Content-Type: application/octet-stream`, little-endian numbers of the type `dtype`, vertex after vertex. The
         *     surface that is answered has the kept vertices in their order.
         */
        post: operations["writeMovedSurface"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/meshes/{id}/vector-transport": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Carries vectors over a surface
         * @description The vector heat method (Sharp, Soliman and Crane 2019): each face gets the vector of the nearest source, carried
         *     there in parallel along a path that is about the shortest: on spheres, away from the point opposite to the source,
         *     it is off by about half a degree on average, which falls only slowly as faces shrink, because the directions in
         *     which heat crosses edges are not consistent. Both heat steps are factored at the first request about a mesh, and
         *     kept. JSON, or with `Accept: application/octet-stream` raw little-endian numbers.
         */
        post: operations["transportVectors"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/meshes/{id}/vertex-map": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Gets the map of vertices
         * @description For each vertex of the uploaded file the vertex of the mesh that it became, in JSON null and in NPY (int32) −1 where
         *     it was dropped; with `of=kept`, for each vertex of the mesh the first of the file.
         */
        get: operations["getVertexMap"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/problems": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Lists problems
         * @description Newest first. Pages stay stable while new problems arrive.
         */
        get: operations["listProblems"];
        put?: never;
        /**
         * Uploads a problem
         * @description A problem is a pencil of sparse symmetric matrices, `S x = λ M x`, that someone else assembled; no mesh belongs to
         *     it. Jobs of the kind `pencil_basis` compute eigenpairs of it.
         *
         *     The body is the matrix S, its mass then being the identity, or `multipart/form-data` with the parts `stiffness` and
         *     `mass` (and, optionally, `name`). Each is an NPZ file of `scipy.sparse.save_npz` (CSR, CSC, COO, DIA or BSR) or
         *     Matrix Market (real, integer or pattern; general or symmetric), told by its first bytes; a mass may also be the
         *     diagonal alone. What `GET /v1/problems/{id}/content` gives is taken as well, with its mass. `Content-Encoding` may
         *     be gzip or zstd.
         *
         *     Both have to be finite and symmetric: entries on either side of the diagonal may differ by 1e-12 of the largest of
         *     their rows, and their mean is taken. The mass has to be positive definite. The first entry or row that does not fit
         *     is named, counted from 0. Where proving the mass definite would take much memory (`mass_proven` is false then), the
         *     first job does it, and fails if it is not.
         *
         *     Equal matrices have the same id, in whichever format they come: sending them again answers 200 with what is stored.
         */
        post: operations["uploadProblem"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/problems/{id}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Shows a problem
         * @description With what was found when it was checked.
         */
        get: operations["showProblem"];
        put?: never;
        post?: never;
        /**
         * Deletes a problem
         * @description Refused while unfinished jobs or bases refer to it, unless `cascade=true`.
         */
        delete: operations["deleteProblem"];
        options?: never;
        head?: never;
        /**
         * Renames a problem
         * @description The name is for people; the id stays.
         */
        patch: operations["renameProblem"];
        trace?: never;
    };
    "/v1/problems/{id}/content": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Gets the matrices of a problem
         * @description As NPZ: `format`, `shape`, `data`, `indices` and `indptr` of S in CSR form, which `scipy.sparse.load_npz` opens; of
         *     the mass the diagonal `mass`, or `mass_data`, `mass_indices` and `mass_indptr` in CSR form, or nothing where it is
         *     the identity.
         */
        get: operations["getProblemContent"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/samples": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Lists the meshes that can be generated
         * @description For a first look at the service without a file at hand; nothing is stored.
         */
        get: operations["listSamples"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/samples/{shape}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Generates a mesh
         * @description The file can be uploaded as it is:
         *     `curl -sS $url/v1/samples/bell | curl -sS $url/v1/meshes?name=bell --data-binary @-`. The same request gives the
         *     same bytes.
         */
        get: operations["getSample"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/shape-comparisons": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Compares shapes by their spectra
         * @description Shape-DNA (Reuter et al. 2006): the Euclidean distances between normalised spectra, which depend neither on the pose
         *     of a shape nor on how it is meshed. By `Accept`: JSON; raw numbers, the matrix of distances; or `image/svg+xml`, the
         *     places as a picture.
         */
        post: operations["compareShapes"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
}
export type webhooks = Record<string, never>;
export interface components {
    schemas: {
        /**
         * @description A long list of parameters, told by its length and its hash.
         * @example {
         *       "blake3": "af1349b9f5f9a1a6a0404dea36dcc9499bcb25c9adc112b7cc9a93cae41f3262",
         *       "numbers": 2930
         *     }
         */
        AbbreviatedList: {
            /** @description The BLAKE3 hash of the values as little-endian f64, 64 hexadecimal digits. */
            blake3: string;
            /**
             * Format: int64
             * @description How many values it has.
             */
            numbers: number;
        };
        /** @description How accurate eigenvalues are to be. In JSON: `"standard"`, `"accurate"`, `{"goal": 0.005}`. */
        Accuracy: ("standard" | "accurate") | components["schemas"]["AccuracyGoal"];
        /**
         * @description The largest relative error of an eigenvalue, as estimated, that is good enough: 1e-4 to 0.5. Where it is
         *     exceeded, columns are added a few times.
         */
        AccuracyGoal: {
            /**
             * Format: double
             * @description The largest relative error of an eigenvalue, as estimated, that is good enough: 1e-4 to 0.5. Where it is
             *     exceeded, columns are added a few times.
             */
            goal: number;
        };
        /** @description How near an approximation came to what was asked for. */
        AccuracyReport: {
            /** @description The dimension of the space in the end. */
            dimension: number;
            /**
             * Format: double
             * @description The largest relative error of an eigenvalue that is good enough.
             */
            goal: number;
            /** @description How many of its columns are hat functions of single vertices. */
            hats: number;
            /**
             * @description The implicit heat steps that smoothed the columns in the end, more than usual where columns have few vertices.
             *     Absent for other constructions.
             */
            heat_steps: number | null;
            /**
             * Format: double
             * @description The largest estimated relative error, the kernel apart.
             */
            largest_estimate: number;
            /** @description Whether that is at most the goal. */
            reached: boolean;
            /**
             * @description How often the space was made finer: by columns that diffuse for longer, by more of them, or by single vertices
             *     where residuals sat.
             */
            rounds: number;
        };
        /** @description A field to stay close to, with a global weight and optionally one for each face. */
        AlignmentRequest: {
            per_face?: components["schemas"]["PerFace"] | null;
            /**
             * @description `curvature`, or a table with a row for each face: three columns are vectors in ℝ³, otherwise the numbers that
             *     are stored in a face; or the id of a stored field.
             */
            to: components["schemas"]["Target"];
            /**
             * Format: double
             * @description The weight of the squared deviation.
             */
            weight: number;
        };
        /** @description A member whose eigenfunctions are in the space. */
        AnchorReport: {
            /**
             * Format: double
             * @description Its `v`.
             */
            curvature: number;
            /**
             * Format: double
             * @description Its `t`.
             */
            extrinsic: number;
            /** @description How they were computed. */
            method: string;
            /**
             * Format: int64
             * @description How many of its pairs were taken.
             */
            pairs: number;
        };
        /** @description The number that pairs were asked for by, as the nearest to it. */
        Around: {
            /**
             * Format: double
             * @description The number.
             */
            shift: number;
            /**
             * @description Pairs of which enclosures do not let one tell which are nearer, delivered or not; empty where these pairs are
             *     proven to be the nearest.
             */
            ties: components["schemas"]["NearPair"][];
        };
        /** @description How much a file says beside positions and faces. */
        AttributeReport: {
            /** @description Names of groups. */
            groups: number;
            /** @description Names of materials. */
            materials: number;
            /**
             * @description Corners of faces that name a texture coordinate or a normal which the file does not have, or which is not
             *     finite; they have none.
             */
            missing: number;
            /** @description Normals of the file. */
            normals: number;
            /** @description Names of objects. */
            objects: number;
            /** @description Texture coordinates of the file. */
            texture_coordinates: number;
        };
        /**
         * @description Two bases, compared.
         * @example {
         *       "angles": [
         *         0,
         *         0.01
         *       ],
         *       "coefficients": null,
         *       "eigenspaces": [
         *         {
         *           "angles": [
         *             0
         *           ],
         *           "error": 0,
         *           "from": 0,
         *           "to": 1
         *         },
         *         {
         *           "angles": [
         *             0.01
         *           ],
         *           "error": 0.01,
         *           "from": 1,
         *           "to": 2
         *         }
         *       ],
         *       "eigenvalue_errors": [
         *         0,
         *         0.003
         *       ],
         *       "following": {
         *         "clusters": [],
         *         "modes": [
         *           {
         *             "mode": 0,
         *             "overlap": 1,
         *             "sign": 1,
         *             "sure": true
         *           },
         *           {
         *             "mode": 1,
         *             "overlap": 0.9999,
         *             "sign": -1,
         *             "sure": true
         *           }
         *         ]
         *       },
         *       "pairs": 2,
         *       "projection_errors": [
         *         0,
         *         0.01
         *       ],
         *       "same_mesh": true
         *     }
         */
        BasisComparisonAnswer: {
            /** @description The principal angles between the spans of all the functions, in radians, ascending. */
            angles: number[];
            coefficients: components["schemas"]["Table"] | null;
            /** @description Clusters of eigenvalues, with the angles between their spaces: single functions of one mean nothing. */
            eigenspaces: components["schemas"]["EigenspaceAnswer"][];
            /** @description Per pair the eigenvalue of the other basis less that of the reference, over that. */
            eigenvalue_errors: number[];
            following: components["schemas"]["FollowingAnswer"] | null;
            /** @description How many pairs were compared. */
            pairs: number;
            /**
             * @description Per function of the other basis, which share of it lies outside of the functions of the reference, in the norm
             *     of the mass.
             */
            projection_errors: number[];
            /**
             * @description Whether both bases are of one mesh, or one problem; null where that is not known, as of two files. If they are
             *     not, their vertices are matched by their numbers alone, as those of one shape in two poses.
             */
            same_mesh: boolean | null;
        };
        /**
         * @description Which bases, and how they are compared.
         * @example {
         *       "other": "019aa5d1-0c2b-7aa1-b7f4-5f0d6a1c2e33",
         *       "pairs": 100,
         *       "reference": "019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10"
         *     }
         */
        BasisComparisonRequest: {
            /** @description Whether to give all Fourier coefficients. */
            coefficients?: boolean;
            /**
             * @description Whether to say which mode of the other basis follows each one of the reference, as from one frame of an
             *     animation to the next.
             */
            following?: boolean;
            /**
             * Format: double
             * @description Eigenvalues of the reference that follow on each other with at most this relative gap are one cluster; for
             *     modes that are followed those of either basis. By default `0.01`.
             */
            gap?: number;
            /** @description The id of the other basis, on as many vertices. */
            other: string;
            /** @description How many of the first pairs of both; without it, as many as both have, at most 1000. */
            pairs?: number | null;
            /**
             * @description The id of the basis that the other one is projected on, an exact one for instance; inner products are by its
             *     mass.
             */
            reference: string;
        };
        /** @description A stored basis without its eigenvalues and certificate, as lists have it. */
        BasisFacts: {
            /**
             * Format: int64
             * @description Bytes of the NPZ file.
             */
            bytes: number;
            /**
             * Format: int64
             * @description Pairs of eigenvalue and eigenfunction that are known, m.
             */
            count: number;
            /**
             * Format: int64
             * @description When it was stored.
             */
            created_ms: number;
            /**
             * Format: int64
             * @description Bytes that the functions would take as a dense matrix of f64.
             */
            dense_bytes: number;
            /**
             * Format: int64
             * @description Columns of the sparse factor, d; null for a dense basis.
             */
            dimension: number | null;
            /** @description A time-ordered UUID. */
            id: string;
            /** @description The job that made it. */
            job: string;
            /** @description Where to go from here. */
            links: components["schemas"]["BasisLinks"];
            /**
             * Format: int64
             * @description Entries of the sparse factor; null for a dense basis.
             */
            nonzeros: number | null;
            /** @description The type of the numbers of a dense basis, `f32` or `f64`; null for a compact one. */
            precision: string | null;
            /**
             * Format: int64
             * @description Numbers of one function as it is lifted: a value per vertex, or two or three per face.
             */
            rows: number;
            /** @description The version of the solver. */
            solver_version: string;
            /** @description Seconds spent in each stage, in order. */
            stage_seconds: components["schemas"]["StageSeconds"][];
            /** @description `compact`: a sparse factor times a dense one; `dense`: the eigenfunctions as columns. */
            storage: string;
            /**
             * Format: int64
             * @description Vertices of the mesh, or rows of the problem, n.
             */
            vertices: number;
        };
        /** @description A field of a basis on the same mesh. */
        BasisField: {
            /** @description `{"design": …}`, `{"coefficients": […]}`, `{"eigenfield": k}` or `{"stored": id}`. */
            field: components["schemas"]["FieldSource"];
            /** @description The id of the basis. */
            id: string;
        };
        /** @description Links of a basis. */
        BasisLinks: {
            /** @description Its factors or its columns as NPZ, safetensors or MatrixMarket. */
            content: string;
            /** @description Of a field basis: designs, a `POST`; null for others, as are the next four. */
            design: string | null;
            /** @description Designs that are kept, a `POST`; `/v1/fields?basis=` lists them. */
            designs: string | null;
            /** @description Its approximate eigenfields. */
            eigenfields: string | null;
            /** @description Fur along a field, a `POST`. */
            fur: string | null;
            /** @description Hatchings along a field, a `POST`. */
            hatching: string | null;
            /** @description Of maps between shapes: the points that correspond; null for others. */
            maps: string | null;
            /** @description Its mesh; null where it has none. */
            mesh: string | null;
            /** @description Its eigenfunctions on the vertices; null where they are no functions on vertices. */
            modes: string | null;
            /** @description Its problem, of the kind `pencil_basis`; null for others. */
            pencil: string | null;
            /** @description The basis itself. */
            self: string;
        };
        /**
         * @description A stored basis.
         * @example {
         *       "bytes": 62012,
         *       "certificate": {
         *         "accuracy": null,
         *         "bounds": [
         *           1e-12,
         *           0.0004,
         *           0.001
         *         ],
         *         "complete": true,
         *         "estimates": [],
         *         "inertia": [
         *           {
         *             "below": 3,
         *             "shift": 2.4
         *           }
         *         ],
         *         "largest_projection_error": null,
         *         "levels": [
         *           {
         *             "dimension": 300,
         *             "iterations": 0,
         *             "shifts": 0
         *           },
         *           {
         *             "dimension": 2930,
         *             "iterations": 1,
         *             "shifts": 1
         *           }
         *         ],
         *         "orthonormality_defect": 1e-13,
         *         "projection_errors": [],
         *         "residuals": [
         *           1e-12,
         *           0.001,
         *           0.002
         *         ],
         *         "tolerance": 0.01
         *       },
         *       "count": 3,
         *       "created_ms": 1795269601000,
         *       "dense_bytes": 70344,
         *       "details": null,
         *       "dimension": null,
         *       "eigenvalues": [
         *         0,
         *         1.31,
         *         2.08
         *       ],
         *       "id": "019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10",
         *       "job": "019aa5d0-5c3e-7c11-8a53-3a0f1c7ce1f2",
         *       "kind": "eigenbasis",
         *       "links": {
         *         "content": "/v1/bases/019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10/content",
         *         "design": null,
         *         "designs": null,
         *         "eigenfields": null,
         *         "fur": null,
         *         "hatching": null,
         *         "maps": null,
         *         "mesh": "/v1/meshes/0f6d2c4ab1e84cf29be2e3f0b5d1a7c3",
         *         "modes": "/v1/bases/019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10/modes",
         *         "pencil": null,
         *         "self": "/v1/bases/019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10"
         *       },
         *       "mesh": "0f6d2c4ab1e84cf29be2e3f0b5d1a7c3",
         *       "nonzeros": null,
         *       "operator": {
         *         "delaunay": false,
         *         "flips": 0,
         *         "laplacian": "cotangent",
         *         "massless_vertices": 0,
         *         "mollification": 0,
         *         "non_manifold_edges": 0,
         *         "non_manifold_vertices": 0,
         *         "reason": "fair_mesh",
         *         "removed_vertices": 0,
         *         "thin_faces": 0,
         *         "zero_area_faces": 0
         *       },
         *       "parameters": {
         *         "boundary": "neumann",
         *         "count": 3,
         *         "mass": "barycentric",
         *         "method": "hsim",
         *         "operator": "auto",
         *         "precision": "f32",
         *         "seed": 0,
         *         "storage": "dense",
         *         "tolerance": 0.01,
         *         "variant": "sliced"
         *       },
         *       "precision": "f32",
         *       "rows": 2930,
         *       "solver_version": "0.1.0+5",
         *       "stage_seconds": [
         *         {
         *           "seconds": 0.001,
         *           "stage": "iterate"
         *         }
         *       ],
         *       "storage": "dense",
         *       "vertices": 2930
         *     }
         */
        BasisResource: components["schemas"]["EigenbasisBasisResource"] | components["schemas"]["FieldBasisBasisResource"] | components["schemas"]["OperatorFamilyBasisResource"] | components["schemas"]["VibrationBasisBasisResource"] | components["schemas"]["PencilBasisBasisResource"] | components["schemas"]["MapCollectionBasisResource"];
        /** @description A stored basis without its eigenvalues and certificate, as lists have it. */
        BasisSummary: components["schemas"]["EigenbasisBasisSummary"] | components["schemas"]["FieldBasisBasisSummary"] | components["schemas"]["OperatorFamilyBasisSummary"] | components["schemas"]["VibrationBasisBasisSummary"] | components["schemas"]["PencilBasisBasisSummary"] | components["schemas"]["MapCollectionBasisSummary"];
        /**
         * @description Which biharmonic energy.
         * @enum {string}
         */
        BiharmonicEnergy: "projected" | "full";
        /**
         * @description What holds at the boundary of the surface.
         * @enum {string}
         */
        Boundary: "neumann" | "dirichlet" | "tangential" | "normal";
        /**
         * @description Where a picture is seen from, in the units of the mesh. Without `eye` it is fitted to the mesh, seen from a
         *     direction.
         */
        CameraRequest: {
            /**
             * Format: double
             * @description The vertical angle of view in degrees. By default `30.0`.
             */
            angle?: number | null;
            /** @description The eye; `target` belongs to it. */
            eye?: number[] | null;
            /**
             * @description In place of `eye` and `target`: from the mesh to the eye, which is so far away that all of the mesh is seen.
             *     `[0.4, 0.3, 1]` where it is left out.
             */
            from?: number[] | null;
            /**
             * Format: int32
             * @description Height of the picture. By default `900`.
             */
            height?: number | null;
            /** @description What the eye looks at. */
            target?: number[] | null;
            /** @description What is up in the picture: `[0, 1, 0]` where it is left out. */
            up?: number[] | null;
            /**
             * Format: int32
             * @description Width of the picture. By default `900`.
             */
            width?: number | null;
        };
        /** @description Functions to be carried over. */
        Carried: {
            /**
             * @description How.
             * @enum {string}
             */
            by?: "points" | "modes";
            /** @description On the source: a row for each vertex. */
            functions: components["schemas"]["Table"];
        };
        /** @description What is proven about a basis. */
        Certificate: {
            accuracy: components["schemas"]["AccuracyReport"] | null;
            around?: components["schemas"]["Around"] | null;
            /**
             * @description Per pair an a-posteriori bound, in 1/length² of the input. Where `complete` is true, the exact eigenvalue of the
             *     same index lies within `[θ − bound, θ + bound]`, rounding errors included; otherwise some exact eigenvalue does.
             */
            bounds: number[];
            /** @description Whether inertia counts prove that no eigenvalue below the last was skipped; `None`: not counted. */
            complete: boolean | null;
            cut?: components["schemas"]["CutCluster"] | null;
            /** @description Per pair an estimate of the error of the eigenvalue, in 1/length² of the input; empty where there is none. */
            estimates: number[];
            /**
             * @description The index of the first pair among all eigenvalues of the problem: zero but where the pairs of an interval were
             *     asked for.
             */
            first?: number;
            /** @description The inertia counts, by ascending shift. */
            inertia: components["schemas"]["InertiaCount"][];
            interval?: components["schemas"]["Interval"] | null;
            /**
             * Format: double
             * @description The largest of them.
             */
            largest_projection_error: number | null;
            /** @description What each level of the hierarchy took, coarsest first; empty where there is no hierarchy. */
            levels: components["schemas"]["LevelReport"][];
            /**
             * Format: double
             * @description The largest entry of `|ΦᵀMΦ − I|`.
             */
            orthonormality_defect: number;
            /**
             * @description Per pair `‖x − x̃‖_M / ‖x‖_M`, where the eigenfunctions `x` were projected to `x̃ = U c` to store them
             *     compactly; else empty.
             */
            projection_errors: number[];
            /**
             * @description Per pair `‖S x − θ M x‖ / ‖S x‖` (thesis, eq. 4.6), of the columns as they are stored; for the kernel
             *     `‖S x‖ / (‖S‖ ‖x‖)`.
             */
            residuals: number[];
            /**
             * Format: double
             * @description The largest residual that a pair was allowed, where the method has one.
             */
            tolerance: number | null;
        };
        /**
         * @description Shapes, compared.
         * @example {
         *       "count": 100,
         *       "descriptors": {
         *         "columns": 2,
         *         "values": [
         *           4.1,
         *           5
         *         ]
         *       },
         *       "distances": {
         *         "columns": 2,
         *         "values": [
         *           0,
         *           3.1,
         *           3.1,
         *           0
         *         ]
         *       },
         *       "held": [
         *         1,
         *         0
         *       ],
         *       "labels": [
         *         "camel-gallop-01",
         *         "horse"
         *       ],
         *       "neighbours": [
         *         [
         *           1
         *         ],
         *         [
         *           0
         *         ]
         *       ],
         *       "places": {
         *         "columns": 2,
         *         "values": [
         *           1.55,
         *           0,
         *           -1.55,
         *           0
         *         ]
         *       }
         *     }
         */
        ComparisonAnswer: {
            /** @description How many eigenvalues were compared. */
            count: number;
            /** @description The normalised spectra: a column for each shape. */
            descriptors: components["schemas"]["Table"];
            /** @description Distances between the shapes: a row and a column for each. */
            distances: components["schemas"]["Table"];
            /** @description How much of the variation each dimension of the places holds, of 1. */
            held: number[];
            /** @description The names of the shapes, in order. */
            labels: string[];
            /** @description For each shape the numbers of its nearest neighbours, nearest first. */
            neighbours: number[][];
            /**
             * @description Places in the plane or in space, a row for each shape, whose distances are near to those (classical
             *     multidimensional scaling).
             */
            places: components["schemas"]["Table"];
        };
        /**
         * @description Which shapes, and how they are compared.
         * @example {
         *       "bases": [
         *         "019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10",
         *         "019aa5d1-0c2b-7aa1-b7f4-5f0d6a1c2e33"
         *       ],
         *       "count": 100,
         *       "dimensions": 2
         *     }
         */
        ComparisonRequest: {
            /** @description The ids of their bases. */
            bases: string[];
            /**
             * @description Eigenvalues above the kernel of the operator; without it, 100, or as many as all bases have. The kernel is one
             *     zero for each part of the mesh that is not held and on which no potential acts: it says nothing of the shape,
             *     and is left out.
             */
            count?: number | null;
            /** @description Dimensions of the places: 2 or 3. By default `2`. */
            dimensions?: number;
            /** @description Names for the picture; without them, those of the meshes. */
            labels?: string[] | null;
            /** @description Whether bases of different operators or conditions at a boundary are compared all the same. */
            mixed?: boolean;
            /** @description Nearest neighbours of each shape that are listed. By default `3`. */
            neighbours?: number;
            /** @description What makes them comparable. */
            scale?: components["schemas"]["ScaleName"];
            /** @description How much each counts. */
            weighting?: components["schemas"]["WeightingName"];
        };
        /**
         * @description Rate and distortion.
         * @example {
         *       "basis_bytes": 17400000,
         *       "basis_from_faces": false,
         *       "bits": 14,
         *       "bits_per_vertex": 0.067,
         *       "bits_per_vertex_with_basis": 2871,
         *       "bytes": 1123,
         *       "nonzeros": 812,
         *       "pairs": 300,
         *       "relative_errors": [
         *         0.004,
         *         0.003,
         *         0.004
         *       ],
         *       "step": 0.0021,
         *       "truncation_errors": [
         *         0.004,
         *         0.003,
         *         0.004
         *       ]
         *     }
         */
        CompressionAnswer: {
            /**
             * Format: int64
             * @description Bytes that the functions of the basis take as they are stored: who decompresses must have them, whatever the
             *     number of pairs.
             */
            basis_bytes: number;
            /**
             * @description Whether whoever has the faces computes the basis anew, so that it need not be sent: it is of the operator
             *     `graph`.
             */
            basis_from_faces: boolean;
            /**
             * Format: int32
             * @description Bits of the largest coefficient.
             */
            bits: number;
            /**
             * Format: double
             * @description The same in bits for each vertex, all functions together.
             */
            bits_per_vertex: number;
            /**
             * Format: double
             * @description Bits for each vertex where the basis has to be sent as well, once.
             */
            bits_per_vertex_with_basis: number;
            /** @description Bytes of the whole, header included. */
            bytes: number;
            /** @description Coefficients that are not zero. */
            nonzeros: number;
            /** @description Modes that are kept. */
            pairs: number;
            /** @description Of each function, how much is lost in the norm of the mass, relative to how far it is from its mean. */
            relative_errors: number[];
            /**
             * Format: double
             * @description The width of a step of the rounding.
             */
            step: number;
            /** @description How much of that the modes that are left out would lose alone. */
            truncation_errors: number[];
        };
        /**
         * @description What to compress, and how far.
         * @example {
         *       "bits": 14,
         *       "functions": "coordinates",
         *       "pairs": 300
         *     }
         */
        CompressionRequest: {
            /**
             * Format: int32
             * @description Bits of the largest coefficient, 2 to 30; 14 by default.
             */
            bits?: number | null;
            /** @description `coordinates`, or a table with a row for each vertex. */
            functions?: components["schemas"]["Functions"];
            /** @description How many modes are kept; all by default. */
            pairs?: number | null;
        };
        /**
         * @description How the subspace is built.
         * @enum {string}
         */
        Construction: "heat" | "radial";
        /** @description What the smoothest cross field is to follow. */
        CrossRequest: {
            /** @description Whether the field runs along boundaries. By default `true`. */
            boundary?: boolean;
            /** @description Directions that are met exactly. */
            constraints?: components["schemas"]["Pin"][];
            /**
             * Format: double
             * @description From how many degrees between the normals of its faces on an edge is a crease, which the field runs along on
             *     both sides; null for none. By default `35.0`.
             */
            creases?: number | null;
            /**
             * Format: double
             * @description The weight of the distance to the principal directions of curvature, on the surface of unit area: from a hundred
             *     on they are followed closely.
             */
            curvature?: number;
            /**
             * @description Whether faces with several creases at no right angles are split at their barycentres, so that each part follows
             *     one of them: without it such a face follows the longest. Whatever is answered is then of the mesh with these
             *     parts, which files have in the place of the kept one. By default `false`.
             */
            split?: boolean;
        };
        /** @description Which cross field: exactly one of the four. */
        CrossSource: components["schemas"]["CrossSourceAligned"] | components["schemas"]["CrossSourceTable"] | components["schemas"]["CrossSourceBasis"] | components["schemas"]["CrossSourceStored"];
        /** @description The smoothest one of all that follow creases and boundaries. */
        CrossSourceAligned: {
            /** @description The smoothest one of all that follow creases and boundaries. */
            aligned: components["schemas"]["CrossRequest"];
        };
        /**
         * @description A field of a basis: of 4-vectors, or of what has directions to be completed to crosses, vectors, 2-vectors and
         *     tensors.
         */
        CrossSourceBasis: {
            /**
             * @description A field of a basis: of 4-vectors, or of what has directions to be completed to crosses, vectors, 2-vectors and
             *     tensors.
             */
            basis: components["schemas"]["BasisField"];
        };
        /**
         * @description The id of a stored field on the same mesh: a saved design of what `basis` may be of, or an upload of what
         *     `table` has.
         */
        CrossSourceStored: {
            /**
             * @description The id of a stored field on the same mesh: a saved design of what `basis` may be of, or an upload of what
             *     `table` has.
             */
            stored: string;
        };
        /**
         * @description A table with a row for each face: a direction of the cross, three numbers in ℝ³, or its representation in the
         *     frame of the face, two numbers whose angle is four times that of the directions; and where directions do not go
         *     on as the nearest ones.
         */
        CrossSourceTable: {
            /**
             * @description A table with a row for each face: a direction of the cross, three numbers in ℝ³, or its representation in the
             *     frame of the face, two numbers whose angle is four times that of the directions; and where directions do not go
             *     on as the nearest ones.
             */
            table: components["schemas"]["CrossTable"];
        };
        /** @description Numbers that make crosses, a row for each face. */
        CrossTable: {
            /**
             * @description Numbers in a row: three are a direction of the cross in ℝ³, two its representation in the frame of the face,
             *     whose angle is four times that of the directions.
             */
            columns: number;
            /**
             * @description The pairs of neighbouring faces between which directions do not go on as the nearest ones, as a design with
             *     exact singularities tells them; singular vertices are then those of the design.
             */
            matching?: components["schemas"]["MatchedFaces"][];
            /**
             * Format: int32
             * @description How many directions a face has in the field whose full turns `matching` counts, 1, 2 or 4: where it is of
             *     vectors, 1, and of lines, 2. By default `4`.
             */
            n?: number;
            /** @description The numbers, row after row; null at faces of a file that have none. */
            values: number[];
        };
        /**
         * @description Eigenvalues that lie so close together that they count as one, of which not all are delivered: any functions of the
         *     cluster's eigenspace could stand for those that are, and another computation may give others.
         */
        CutCluster: {
            /** @description One more than the index of its last, or of the last that may belong to it. */
            end: number;
            /** @description The index of its first eigenvalue among all, from 0. */
            first: number;
        };
        /** @description A cut edge. */
        CutEdge: {
            /** @description Its faces. */
            faces: number[];
            /**
             * Format: int32
             * @description From the first face to the second.
             */
            quarters: number;
            /** @description Its vertices, in the direction in which the first face runs along it. */
            vertices: number[];
        };
        /** @description Damping `α M + β K`. */
        DampingRequest: {
            /**
             * Format: double
             * @description In 1/time. By default `0.0`.
             */
            alpha?: number;
            /**
             * Format: double
             * @description In time. By default `0.0`.
             */
            beta?: number;
        };
        /**
         * @description The parts of a field: they add up to it, and are orthogonal to each other.
         * @example {
         *       "cogradient": [
         *         0,
         *         0.3,
         *         0
         *       ],
         *       "columns": 3,
         *       "gradient": [
         *         0.4,
         *         0,
         *         0
         *       ],
         *       "harmonic": [
         *         0,
         *         0,
         *         0
         *       ],
         *       "potential": [
         *         0.1,
         *         -0.1,
         *         0
         *       ],
         *       "shares": [
         *         0.64,
         *         0.36,
         *         0
         *       ]
         *     }
         */
        DecompositionAnswer: {
            /** @description A gradient turned by 90°: without divergence. */
            cogradient: number[];
            /** @description Numbers of each face, as the field was given. */
            columns: number;
            /** @description The gradient of `potential`: without curl. */
            gradient: number[];
            /** @description What is left, without either: of the harmonic fields of handles and holes. */
            harmonic: number[];
            /**
             * @description The function on the vertices whose gradient is `gradient`, in the units of the field times those of the mesh;
             *     its mean on each component is 0 where no boundary holds it.
             */
            potential: number[];
            /** @description The squared length of gradient, co-gradient and harmonic part, as shares of that of the field (norms by area). */
            shares: number[];
        };
        /** @description A vector field to be decomposed. */
        DecompositionRequest: {
            /**
             * @description Which potentials vanish at a boundary: those of co-gradients (`tangential`: co-gradients and harmonic fields run
             *     along it), or those of gradients (`normal`: gradients and harmonic fields run across it).
             */
            boundary?: components["schemas"]["FieldBoundary"];
            /**
             * @description The field, a row for each face: two columns are numbers in the frame of the face, three a vector in ℝ³, whose
             *     part across the face is left out.
             */
            field: components["schemas"]["Table"];
        };
        /** @description One kind of defect, how often it occurs, and the first offenders. */
        Defect: {
            /** @description How often. */
            count: number;
            /** @description What the examples number. */
            element: components["schemas"]["Element"];
            /**
             * @description The first offenders (at most `EXAMPLES`), numbered from 0 as in the input. An edge is named by a face beside
             *     it.
             */
            examples: number[];
            /** @description What is wrong. */
            kind: components["schemas"]["DefectKind"];
        };
        /**
         * @description The kinds of defect.
         * @enum {string}
         */
        DefectKind: "index_out_of_range" | "non_finite" | "out_of_range" | "repeated_vertex" | "zero_area" | "duplicate_face" | "unreferenced_vertex" | "equal_position" | "non_manifold_edge" | "non_manifold_vertex" | "inconsistent_orientation" | "triangle_off_boundary" | "boundary_not_given" | "off_surface" | "disputed_triangle";
        /** @description Functions that are known on both surfaces. */
        Descriptors: {
            /** @description On the source: a row for each vertex. */
            source: components["schemas"]["Table"];
            /** @description On the target: as many columns. */
            target: components["schemas"]["Table"];
        };
        /**
         * @description A designed field.
         * @example {
         *       "alignment_energy": null,
         *       "biharmonic_energy": 122.4,
         *       "coefficients": [
         *         0.31,
         *         -0.02
         *       ],
         *       "error": 0.011,
         *       "euler_characteristic": 2,
         *       "faces": [
         *         17,
         *         4031
         *       ],
         *       "field": null,
         *       "harmonic_energy": 4.81,
         *       "index_sum": 2,
         *       "matching": null,
         *       "residuals": [
         *         0.013,
         *         0
         *       ],
         *       "singularities": [
         *         {
         *           "index": 1,
         *           "vertex": 88
         *         },
         *         {
         *           "index": 1,
         *           "vertex": 2101
         *         }
         *       ],
         *       "space": "surface"
         *     }
         */
        DesignAnswer: {
            /**
             * Format: double
             * @description The squared deviation from what the field is aligned to, on the surface of unit area.
             */
            alignment_energy: number | null;
            /**
             * Format: double
             * @description The biharmonic energy, on the surface of unit area.
             */
            biharmonic_energy: number;
            /** @description Coefficients in the space. */
            coefficients: number[];
            /**
             * Format: double
             * @description How far the field of the coefficients is from that of least energy among all fields of the surface, as a share
             *     of its length (norms by area). Where that field is the answer, this is the distance; else with `error` an
             *     estimate of it, and without null.
             */
            error: number | null;
            /**
             * Format: int64
             * @description The Euler characteristic of the surface.
             */
            euler_characteristic: number | null;
            /** @description The face of each constraint, strokes first. */
            faces: number[];
            field: components["schemas"]["LiftedField"] | null;
            /**
             * Format: double
             * @description The harmonic energy of the field, on the surface of unit area.
             */
            harmonic_energy: number;
            /**
             * Format: double
             * @description The sum of the indices: the Euler characteristic where the surface is closed.
             */
            index_sum: number | null;
            /**
             * @description With `exact` singularities the pairs of neighbouring faces across which the field turns by more than half a
             *     turn; all others match by the least angle.
             */
            matching: components["schemas"]["MatchedFaces"][] | null;
            /** @description For each constraint the length of what is missing, in stored numbers. */
            residuals: number[];
            /** @description The singular vertices inside the surface with their indices, where they are asked for. */
            singularities: components["schemas"]["SingularVertex"][] | null;
            /**
             * @description Which fields the field is the one of least energy of: `surface`, all fields of the surface, or `basis`, those of
             *     the space.
             * @example surface
             */
            space: string;
        };
        /**
         * @description What field is wanted. A front-end sends the whole of it again whenever a stroke moves: what does not change costs
         *     nothing.
         */
        DesignRequest: {
            alignment?: components["schemas"]["AlignmentRequest"] | null;
            /** @description What the field has to be. */
            constraints?: components["schemas"]["Pin"][];
            /**
             * @description Whether to estimate how far the field is from that of least energy among all fields of the surface, as a share
             *     of its length. Where that field is the answer, JSON tells in any case how far the field of the coefficients is
             *     from it.
             */
            error?: boolean;
            faces?: components["schemas"]["FacesRequest"] | null;
            /**
             * Format: double
             * @description Asks for the field of least energy among all fields of the surface itself, in place of that in the space of the
             *     basis: to this relative tolerance, from 1e-10 to below 1.
             */
            refine?: number | null;
            singularities?: components["schemas"]["SingularitiesRequest"] | null;
            /**
             * @description Which fields the design is the one of least energy of: by default all fields of the surface where there is
             *     memory for two sparse factors of it, else those of the space of the basis.
             */
            space?: components["schemas"]["DesignSpace"];
            /** @description Where the field should go along, softly. */
            strokes?: components["schemas"]["Stroke"][];
            /** @description Weights of the energies. */
            weights?: components["schemas"]["Weights"];
        };
        /**
         * @description Which fields a design is the one of least energy of.
         * @enum {string}
         */
        DesignSpace: "auto" | "basis" | "surface";
        /** @description A distance on the surface. */
        DistanceKind: components["schemas"]["DistanceKindDiffusion"] | components["schemas"]["DistanceKindBiharmonic"] | components["schemas"]["DistanceKindCommuteTime"] | components["schemas"]["DistanceKindGeodesic"];
        /** @description `d² = Σ (φ(x) − φ(y))² / λ²`. */
        DistanceKindBiharmonic: {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "biharmonic";
        };
        /** @description `d² = Σ (φ(x) − φ(y))² / λ`. */
        DistanceKindCommuteTime: {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "commute_time";
        };
        /** @description `d² = Σ e^{−2λt} (φ(x) − φ(y))²`, for each of the times. */
        DistanceKindDiffusion: {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "diffusion";
            /** @description Times above zero, in length² of the mesh; without them, half the inverse of the first eigenvalue above zero. */
            times?: number[] | null;
        };
        /**
         * @description Geodesic distance. Vertices that no path leads to are at an infinite distance, `null` in JSON, but for
         *     `spectral`, which cannot tell.
         */
        DistanceKindGeodesic: {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "geodesic";
            /**
             * @description How it is computed.
             * @enum {string}
             */
            method?: "heat" | "exact" | "spectral";
            /**
             * Format: double
             * @description How long heat flows, in length² of the mesh; without it, the square of the mean edge, and by `spectral` for
             *     each face the shortest of a ladder of times at which heat reaches it. Not for `exact`.
             */
            time?: number | null;
        };
        /**
         * @description Which distances, and between what.
         * @example {
         *       "distance": {
         *         "kind": "diffusion",
         *         "times": [
         *           0.01,
         *           0.1
         *         ]
         *       },
         *       "nearest": false,
         *       "sources": [
         *         17,
         *         2930
         *       ]
         *     }
         */
        DistanceRequest: {
            /** @description The distance. */
            distance: components["schemas"]["DistanceKind"];
            /** @description Whether to give the distance to the nearest source alone. */
            nearest?: boolean;
            /** @description Pairs of vertices that distances are measured between; instead of `sources`. */
            pairs?: number[][];
            /** @description Vertices that distances of all vertices are measured from; instead of `pairs`. */
            sources?: number[];
        };
        /** @description A stored basis. Of the kind `eigenbasis`. */
        EigenbasisBasisResource: components["schemas"]["EigenbasisBasisSummary"] & {
            /**
             * @description What is proven: per pair a residual and a bound; the defect of orthonormality; with `method: hsim` whether
             *     nothing was skipped. Of a field basis: of the lowest eigenvalues `estimates` of their errors, `bounds`, and
             *     whether they are as good as is usual, in `accuracy`. Null where nothing is.
             */
            certificate: components["schemas"]["Certificate"];
            /**
             * @description What only this kind of basis has. Of a field basis: `field` (its kind), `faces`, `numbers_per_face`,
             *     `dense_columns` (for the harmonic fields of handles), `nonzeros_per_row` and the `area` of the surface. Of maps:
             *     `bases`, `meshes` and `vertices` of the shapes, and how consistent they are, `cycles`. Of any kind, where a
             *     graphics card took part in it or failed to: `dense_solver`, a list of what solved its dense problems, and
             *     `measured_on`, of what measured its errors. Of eigenpairs, where a faster way was given up for a surer one:
             *     `fallbacks`, a list of what and why. Null where there is nothing of this.
             */
            details: components["schemas"]["EigenbasisDetails"] | null;
            /** @description m eigenvalues, ascending, in 1/length² of the mesh. */
            eigenvalues: number[];
            /**
             * @description How the operator was made, and why: `laplacian` (`cotangent`, `robust`, `volume` or `graph`) with its `reason`,
             *     what was found of the mesh, how many vertices are no unknowns; of a solid also its `domain`, `solid` or
             *     `surface_of_solid`. Null where the kind has no such choice.
             */
            operator: components["schemas"]["EigenbasisOperator"];
        } & {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "eigenbasis";
        };
        /** @description A stored basis without its eigenvalues and certificate, as lists have it. Of the kind `eigenbasis`. */
        EigenbasisBasisSummary: components["schemas"]["BasisFacts"] & {
            /**
             * @description The kind of job.
             * @enum {string}
             */
            kind: "eigenbasis";
            /** @description The mesh it lives on; null where it is of a problem. */
            mesh: string;
            parameters: components["schemas"]["EigenbasisParametersShown"];
        } & {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "eigenbasis";
        };
        /** @description The fast approximation: Ritz pairs in a subspace of locally supported functions, with an estimate and a bound for each. */
        EigenbasisByApproximation: {
            accuracy?: components["schemas"]["Accuracy"] | null;
            boundary?: components["schemas"]["Boundary"] | null;
            /**
             * @description Whether eigenvalues are counted once and each pair is enclosed with its index: `complete` is true then, or the
             *     job fails.
             * @example true
             */
            certify?: boolean | null;
            construction?: components["schemas"]["Construction"] | null;
            /**
             * @description Eigenpairs, the kernel included. 100, unless it is given or bounds take its place.
             * @example 250
             */
            count?: number | null;
            /**
             * @description Functions of the subspace, at least the count; twice the count and at least the count plus 150, unless it is
             *     given.
             * @example 1000
             */
            dimension?: number | null;
            heat?: components["schemas"]["HeatParameters"] | null;
            mass?: components["schemas"]["MassKind"] | null;
            /**
             * @description How it is computed.
             * @enum {string}
             */
            method: "approximate";
            operator?: components["schemas"]["OperatorKind"] | null;
            /**
             * @description Into how many parts a server divides the job, for several workers to solve at once: a number, or `auto`. The job
             *     waits for its parts without a worker, and joins them. Not divided, unless it is given. Of `hsim` in the variant
             *     `sliced`, on surfaces, stored as columns: parts of 64 pairs at least, with the same result but for rounding. Of
             *     `approximate`, for the Laplacian by cotangents with a lumped mass: parts of the surface, with the same pairs and
             *     somewhat wider bounds.
             */
            parts?: ("auto" | number) | null;
            precision?: components["schemas"]["Precision"] | null;
            radial?: components["schemas"]["RadialParameters"] | null;
            refinement?: components["schemas"]["Refinement"] | null;
            /**
             * Format: int64
             * @description Seeds everything that is drawn at random; 0, unless it is given.
             * @example 0
             */
            seed?: number | null;
        };
        /** @description The fast approximation: Ritz pairs in a subspace of locally supported functions, with an estimate and a bound for each. */
        EigenbasisByApproximationShown: {
            accuracy?: components["schemas"]["Accuracy"] | null;
            boundary?: components["schemas"]["Boundary"] | null;
            /**
             * @description Whether eigenvalues are counted once and each pair is enclosed with its index: `complete` is true then, or the
             *     job fails.
             * @example true
             */
            certify?: boolean | null;
            construction?: components["schemas"]["Construction"] | null;
            /**
             * @description Eigenpairs, the kernel included. 100, unless it is given or bounds take its place.
             * @example 250
             */
            count?: number | null;
            /**
             * @description Functions of the subspace, at least the count; twice the count and at least the count plus 150, unless it is
             *     given.
             * @example 1000
             */
            dimension?: number | null;
            heat?: components["schemas"]["HeatParameters"] | null;
            mass?: components["schemas"]["MassKind"] | null;
            /**
             * @description How it is computed.
             * @enum {string}
             */
            method: "approximate";
            operator?: components["schemas"]["OperatorKindShown"] | null;
            /**
             * @description Into how many parts a server divides the job, for several workers to solve at once: a number, or `auto`. The job
             *     waits for its parts without a worker, and joins them. Not divided, unless it is given. Of `hsim` in the variant
             *     `sliced`, on surfaces, stored as columns: parts of 64 pairs at least, with the same result but for rounding. Of
             *     `approximate`, for the Laplacian by cotangents with a lumped mass: parts of the surface, with the same pairs and
             *     somewhat wider bounds.
             */
            parts?: ("auto" | number) | null;
            precision?: components["schemas"]["Precision"] | null;
            radial?: components["schemas"]["RadialParameters"] | null;
            refinement?: components["schemas"]["Refinement"] | null;
            /**
             * Format: int64
             * @description Seeds everything that is drawn at random; 0, unless it is given.
             * @example 0
             */
            seed?: number | null;
        };
        /** @description `hsim` where that is expected to take about a second or less, else `approximate`, and `hsim` after all where that misses its goal. A member that one method alone takes chooses that method. */
        EigenbasisByAuto: {
            accuracy?: components["schemas"]["Accuracy"] | null;
            /**
             * @description With `below` or `between`: so many pairs below the upper bound, 1000 unless it is given.
             * @example 400
             */
            at_most?: number | null;
            /**
             * Format: double
             * @description All pairs below this eigenvalue, in 1/length² of the mesh, instead of a count.
             * @example 900
             */
            below?: number | null;
            /**
             * @description `[from, to]`: all pairs of an interval, `from` included and `to` not, in 1/length² of the mesh, instead of a
             *     count. All below `to` are computed.
             * @example [
             *       100,
             *       900
             *     ]
             */
            between?: number[] | null;
            boundary?: components["schemas"]["Boundary"] | null;
            /**
             * @description Whether eigenvalues are counted once and each pair is enclosed with its index: `complete` is true then, or the
             *     job fails.
             * @example true
             */
            certify?: boolean | null;
            construction?: components["schemas"]["Construction"] | null;
            /**
             * @description Eigenpairs, the kernel included. 100, unless it is given or bounds take its place.
             * @example 250
             */
            count?: number | null;
            /**
             * @description Functions of the subspace, at least the count; twice the count and at least the count plus 150, unless it is
             *     given.
             * @example 1000
             */
            dimension?: number | null;
            heat?: components["schemas"]["HeatParameters"] | null;
            /**
             * @description Levels of the hierarchy; by the size of the mesh and the count, unless it is given.
             * @example 3
             */
            levels?: number | null;
            mass?: components["schemas"]["MassKind"] | null;
            /**
             * @description How it is computed. By default `"auto"`.
             * @enum {string}
             */
            method?: "auto";
            operator?: components["schemas"]["OperatorKind"] | null;
            /**
             * @description Into how many parts a server divides the job, for several workers to solve at once: a number, or `auto`. The job
             *     waits for its parts without a worker, and joins them. Not divided, unless it is given. Of `hsim` in the variant
             *     `sliced`, on surfaces, stored as columns: parts of 64 pairs at least, with the same result but for rounding. Of
             *     `approximate`, for the Laplacian by cotangents with a lumped mass: parts of the surface, with the same pairs and
             *     somewhat wider bounds.
             */
            parts?: ("auto" | number) | null;
            precision?: components["schemas"]["Precision"] | null;
            radial?: components["schemas"]["RadialParameters"] | null;
            refinement?: components["schemas"]["Refinement"] | null;
            /**
             * Format: int64
             * @description Seeds everything that is drawn at random; 0, unless it is given.
             * @example 0
             */
            seed?: number | null;
            /**
             * Format: double
             * @description Of the variant `published`: where the shift lies between the eigenvalues that are known.
             * @example 0.4
             */
            shift_ratio?: number | null;
            /**
             * Format: double
             * @description How many samples the support of a function of the hierarchy holds on average.
             * @example 10
             */
            sigma?: number | null;
            start?: components["schemas"]["Start"] | null;
            storage?: components["schemas"]["StorageKind"] | null;
            /**
             * Format: double
             * @description The size of the subspace that is iterated, over that of the pairs wanted.
             * @example 1.5
             */
            subspace_factor?: number | null;
            /**
             * Format: double
             * @description The largest residual ‖Sx − θMx‖ / ‖Sx‖ of a pair, 0.01 unless it is given.
             * @example 0.000001
             */
            tolerance?: number | null;
            variant?: components["schemas"]["HsimVariant"] | null;
        };
        /** @description `hsim` where that is expected to take about a second or less, else `approximate`, and `hsim` after all where that misses its goal. A member that one method alone takes chooses that method. */
        EigenbasisByAutoShown: {
            accuracy?: components["schemas"]["Accuracy"] | null;
            /**
             * @description With `below` or `between`: so many pairs below the upper bound, 1000 unless it is given.
             * @example 400
             */
            at_most?: number | null;
            /**
             * Format: double
             * @description All pairs below this eigenvalue, in 1/length² of the mesh, instead of a count.
             * @example 900
             */
            below?: number | null;
            /**
             * @description `[from, to]`: all pairs of an interval, `from` included and `to` not, in 1/length² of the mesh, instead of a
             *     count. All below `to` are computed.
             * @example [
             *       100,
             *       900
             *     ]
             */
            between?: number[] | null;
            boundary?: components["schemas"]["Boundary"] | null;
            /**
             * @description Whether eigenvalues are counted once and each pair is enclosed with its index: `complete` is true then, or the
             *     job fails.
             * @example true
             */
            certify?: boolean | null;
            construction?: components["schemas"]["Construction"] | null;
            /**
             * @description Eigenpairs, the kernel included. 100, unless it is given or bounds take its place.
             * @example 250
             */
            count?: number | null;
            /**
             * @description Functions of the subspace, at least the count; twice the count and at least the count plus 150, unless it is
             *     given.
             * @example 1000
             */
            dimension?: number | null;
            heat?: components["schemas"]["HeatParameters"] | null;
            /**
             * @description Levels of the hierarchy; by the size of the mesh and the count, unless it is given.
             * @example 3
             */
            levels?: number | null;
            mass?: components["schemas"]["MassKind"] | null;
            /**
             * @description How it is computed.
             * @enum {string}
             */
            method?: "auto";
            operator?: components["schemas"]["OperatorKindShown"] | null;
            /**
             * @description Into how many parts a server divides the job, for several workers to solve at once: a number, or `auto`. The job
             *     waits for its parts without a worker, and joins them. Not divided, unless it is given. Of `hsim` in the variant
             *     `sliced`, on surfaces, stored as columns: parts of 64 pairs at least, with the same result but for rounding. Of
             *     `approximate`, for the Laplacian by cotangents with a lumped mass: parts of the surface, with the same pairs and
             *     somewhat wider bounds.
             */
            parts?: ("auto" | number) | null;
            precision?: components["schemas"]["Precision"] | null;
            radial?: components["schemas"]["RadialParameters"] | null;
            refinement?: components["schemas"]["Refinement"] | null;
            /**
             * Format: int64
             * @description Seeds everything that is drawn at random; 0, unless it is given.
             * @example 0
             */
            seed?: number | null;
            /**
             * Format: double
             * @description Of the variant `published`: where the shift lies between the eigenvalues that are known.
             * @example 0.4
             */
            shift_ratio?: number | null;
            /**
             * Format: double
             * @description How many samples the support of a function of the hierarchy holds on average.
             * @example 10
             */
            sigma?: number | null;
            start?: components["schemas"]["Start"] | null;
            storage?: components["schemas"]["StorageKind"] | null;
            /**
             * Format: double
             * @description The size of the subspace that is iterated, over that of the pairs wanted.
             * @example 1.5
             */
            subspace_factor?: number | null;
            /**
             * Format: double
             * @description The largest residual ‖Sx − θMx‖ / ‖Sx‖ of a pair, 0.01 unless it is given.
             * @example 0.000001
             */
            tolerance?: number | null;
            variant?: components["schemas"]["HsimVariant"] | null;
        };
        /** @description The hierarchical subspace iteration method: pairs to a tolerance, proven complete. */
        EigenbasisByHsim: {
            /**
             * @description With `below` or `between`: so many pairs below the upper bound, 1000 unless it is given.
             * @example 400
             */
            at_most?: number | null;
            /**
             * Format: double
             * @description All pairs below this eigenvalue, in 1/length² of the mesh, instead of a count.
             * @example 900
             */
            below?: number | null;
            /**
             * @description `[from, to]`: all pairs of an interval, `from` included and `to` not, in 1/length² of the mesh, instead of a
             *     count. All below `to` are computed.
             * @example [
             *       100,
             *       900
             *     ]
             */
            between?: number[] | null;
            boundary?: components["schemas"]["Boundary"] | null;
            /**
             * @description Eigenpairs, the kernel included. 100, unless it is given or bounds take its place.
             * @example 250
             */
            count?: number | null;
            /**
             * @description Levels of the hierarchy; by the size of the mesh and the count, unless it is given.
             * @example 3
             */
            levels?: number | null;
            mass?: components["schemas"]["MassKind"] | null;
            /**
             * @description How it is computed.
             * @enum {string}
             */
            method: "hsim";
            operator?: components["schemas"]["OperatorKind"] | null;
            /**
             * @description Into how many parts a server divides the job, for several workers to solve at once: a number, or `auto`. The job
             *     waits for its parts without a worker, and joins them. Not divided, unless it is given. Of `hsim` in the variant
             *     `sliced`, on surfaces, stored as columns: parts of 64 pairs at least, with the same result but for rounding. Of
             *     `approximate`, for the Laplacian by cotangents with a lumped mass: parts of the surface, with the same pairs and
             *     somewhat wider bounds.
             */
            parts?: ("auto" | number) | null;
            precision?: components["schemas"]["Precision"] | null;
            /**
             * Format: int64
             * @description Seeds everything that is drawn at random; 0, unless it is given.
             * @example 0
             */
            seed?: number | null;
            /**
             * Format: double
             * @description Of the variant `published`: where the shift lies between the eigenvalues that are known.
             * @example 0.4
             */
            shift_ratio?: number | null;
            /**
             * Format: double
             * @description How many samples the support of a function of the hierarchy holds on average.
             * @example 10
             */
            sigma?: number | null;
            storage?: components["schemas"]["StorageKind"] | null;
            /**
             * Format: double
             * @description The size of the subspace that is iterated, over that of the pairs wanted.
             * @example 1.5
             */
            subspace_factor?: number | null;
            /**
             * Format: double
             * @description The largest residual ‖Sx − θMx‖ / ‖Sx‖ of a pair, 0.01 unless it is given.
             * @example 0.000001
             */
            tolerance?: number | null;
            variant?: components["schemas"]["HsimVariant"] | null;
        };
        /** @description The hierarchical subspace iteration method: pairs to a tolerance, proven complete. */
        EigenbasisByHsimShown: {
            /**
             * @description With `below` or `between`: so many pairs below the upper bound, 1000 unless it is given.
             * @example 400
             */
            at_most?: number | null;
            /**
             * Format: double
             * @description All pairs below this eigenvalue, in 1/length² of the mesh, instead of a count.
             * @example 900
             */
            below?: number | null;
            /**
             * @description `[from, to]`: all pairs of an interval, `from` included and `to` not, in 1/length² of the mesh, instead of a
             *     count. All below `to` are computed.
             * @example [
             *       100,
             *       900
             *     ]
             */
            between?: number[] | null;
            boundary?: components["schemas"]["Boundary"] | null;
            /**
             * @description Eigenpairs, the kernel included. 100, unless it is given or bounds take its place.
             * @example 250
             */
            count?: number | null;
            /**
             * @description Levels of the hierarchy; by the size of the mesh and the count, unless it is given.
             * @example 3
             */
            levels?: number | null;
            mass?: components["schemas"]["MassKind"] | null;
            /**
             * @description How it is computed.
             * @enum {string}
             */
            method: "hsim";
            operator?: components["schemas"]["OperatorKindShown"] | null;
            /**
             * @description Into how many parts a server divides the job, for several workers to solve at once: a number, or `auto`. The job
             *     waits for its parts without a worker, and joins them. Not divided, unless it is given. Of `hsim` in the variant
             *     `sliced`, on surfaces, stored as columns: parts of 64 pairs at least, with the same result but for rounding. Of
             *     `approximate`, for the Laplacian by cotangents with a lumped mass: parts of the surface, with the same pairs and
             *     somewhat wider bounds.
             */
            parts?: ("auto" | number) | null;
            precision?: components["schemas"]["Precision"] | null;
            /**
             * Format: int64
             * @description Seeds everything that is drawn at random; 0, unless it is given.
             * @example 0
             */
            seed?: number | null;
            /**
             * Format: double
             * @description Of the variant `published`: where the shift lies between the eigenvalues that are known.
             * @example 0.4
             */
            shift_ratio?: number | null;
            /**
             * Format: double
             * @description How many samples the support of a function of the hierarchy holds on average.
             * @example 10
             */
            sigma?: number | null;
            storage?: components["schemas"]["StorageKind"] | null;
            /**
             * Format: double
             * @description The size of the subspace that is iterated, over that of the pairs wanted.
             * @example 1.5
             */
            subspace_factor?: number | null;
            /**
             * Format: double
             * @description The largest residual ‖Sx − θMx‖ / ‖Sx‖ of a pair, 0.01 unless it is given.
             * @example 0.000001
             */
            tolerance?: number | null;
            variant?: components["schemas"]["HsimVariant"] | null;
        };
        /** @description Plain subspace iteration: a baseline. */
        EigenbasisBySim: {
            boundary?: components["schemas"]["Boundary"] | null;
            /**
             * @description Eigenpairs, the kernel included. 100, unless it is given or bounds take its place.
             * @example 250
             */
            count?: number | null;
            mass?: components["schemas"]["MassKind"] | null;
            /**
             * @description How it is computed.
             * @enum {string}
             */
            method: "sim";
            operator?: components["schemas"]["OperatorKind"] | null;
            precision?: components["schemas"]["Precision"] | null;
            /**
             * Format: int64
             * @description Seeds everything that is drawn at random; 0, unless it is given.
             * @example 0
             */
            seed?: number | null;
            start?: components["schemas"]["Start"] | null;
            storage?: components["schemas"]["StorageKind"] | null;
            /**
             * Format: double
             * @description The size of the subspace that is iterated, over that of the pairs wanted.
             * @example 1.5
             */
            subspace_factor?: number | null;
            /**
             * Format: double
             * @description The largest residual ‖Sx − θMx‖ / ‖Sx‖ of a pair, 0.01 unless it is given.
             * @example 0.000001
             */
            tolerance?: number | null;
        };
        /** @description Plain subspace iteration: a baseline. */
        EigenbasisBySimShown: {
            boundary?: components["schemas"]["Boundary"] | null;
            /**
             * @description Eigenpairs, the kernel included. 100, unless it is given or bounds take its place.
             * @example 250
             */
            count?: number | null;
            mass?: components["schemas"]["MassKind"] | null;
            /**
             * @description How it is computed.
             * @enum {string}
             */
            method: "sim";
            operator?: components["schemas"]["OperatorKindShown"] | null;
            precision?: components["schemas"]["Precision"] | null;
            /**
             * Format: int64
             * @description Seeds everything that is drawn at random; 0, unless it is given.
             * @example 0
             */
            seed?: number | null;
            start?: components["schemas"]["Start"] | null;
            storage?: components["schemas"]["StorageKind"] | null;
            /**
             * Format: double
             * @description The size of the subspace that is iterated, over that of the pairs wanted.
             * @example 1.5
             */
            subspace_factor?: number | null;
            /**
             * Format: double
             * @description The largest residual ‖Sx − θMx‖ / ‖Sx‖ of a pair, 0.01 unless it is given.
             * @example 0.000001
             */
            tolerance?: number | null;
        };
        /** @description How a basis came about. */
        EigenbasisDetails: {
            /**
             * @description A note for each dense problem: the graphics card that solved it, or why it did not; absent where no card had to
             *     do with it.
             */
            dense_solver?: string[];
            /** @description Where a faster way was given up for a surer one, and why; absent where none was. */
            fallbacks?: string[];
            /**
             * @description The graphics card that measured the errors of an approximation, a note for each time, or why it did not; absent
             *     where no card had to do with it.
             */
            measured_on?: string[];
            /** @description The parts that it was joined of, from the lowest pairs up; absent where it was solved in one piece. */
            parts?: {
                /**
                 * Format: int64
                 * @description Its pairs, those that it shares with its neighbours included; 0 where it was given up, and of an approximation,
                 *     whose parts are of the surface.
                 */
                pairs: number;
                /**
                 * Format: int64
                 * @description Which one, from 1.
                 */
                part: number;
                /**
                 * Format: double
                 * @description Seconds that it took.
                 */
                seconds: number;
                /**
                 * Format: int64
                 * @description Threads that solved it.
                 */
                threads: number;
                /**
                 * Format: int64
                 * @description Of an approximation, the vertices on which it measured all pairs; else 0.
                 */
                unknowns: number | null;
            }[];
        };
        /** @description A job to be done. Of the kind `eigenbasis`. */
        EigenbasisJobRequest: {
            /**
             * @description The kind of job. (enum property replaced by openapi-typescript)
             * @enum {string}
             */
            kind: "eigenbasis";
            /** @description The id of the mesh. */
            mesh: string;
            /** @description Parameters; what is absent takes its default. */
            parameters?: components["schemas"]["EigenbasisParameters"];
            /**
             * Format: int32
             * @description Higher runs first. By default `0`.
             */
            priority?: number;
        };
        /** @description A job. Of the kind `eigenbasis`. */
        EigenbasisJobResource: components["schemas"]["JobFacts"] & {
            /**
             * @description The kind of job.
             * @enum {string}
             */
            kind: "eigenbasis";
            /** @description The mesh it works on; null where it works on a problem. */
            mesh: string;
            parameters: components["schemas"]["EigenbasisParametersShown"];
        } & {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "eigenbasis";
        };
        /** @description How the operator of an eigenbasis was made: of functions, or of eigenfields. */
        EigenbasisOperator: components["schemas"]["FunctionOperator"] | components["schemas"]["HodgeOperator"];
        /** @description Every member that some method takes; `None` is what was not given. */
        EigenbasisParameters: components["schemas"]["EigenbasisByAuto"] | components["schemas"]["EigenbasisByApproximation"] | components["schemas"]["EigenbasisByHsim"] | components["schemas"]["EigenbasisBySim"];
        /** @description Every member that some method takes; `None` is what was not given. */
        EigenbasisParametersShown: components["schemas"]["EigenbasisByAutoShown"] | components["schemas"]["EigenbasisByApproximationShown"] | components["schemas"]["EigenbasisByHsimShown"] | components["schemas"]["EigenbasisBySimShown"];
        /** @description A job. Of the kind `eigenbasis_part`. */
        EigenbasisPartJobResource: components["schemas"]["JobFacts"] & {
            /**
             * @description The kind of job.
             * @enum {string}
             */
            kind: "eigenbasis_part";
            /** @description The mesh it works on; null where it works on a problem. */
            mesh: string;
            parameters: components["schemas"]["EigenbasisPartParametersShown"];
        } & {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "eigenbasis_part";
        };
        /** @description The parameters of a job that solves a part of another. */
        EigenbasisPartParametersShown: {
            /**
             * Format: int64
             * @description Of so many.
             */
            of: number;
            parameters: components["schemas"]["EigenbasisParametersShown"];
            /**
             * Format: int64
             * @description Which part, from 1.
             */
            part: number;
        };
        /** @description A cluster of eigenvalues, and the spaces of its functions. */
        EigenspaceAnswer: {
            /** @description The principal angles between its spaces in the two bases, in radians, ascending. */
            angles: number[];
            /**
             * Format: double
             * @description The sine of the largest: the distance of the two spaces.
             */
            error: number;
            /** @description Its first mode. */
            from: number;
            /** @description The mode after its last. */
            to: number;
        };
        /** @description What assembly came across. */
        ElasticReport: {
            /** @description Vertices that are held fast, each counted once. */
            clamped: number;
            /** @description Faces or tetrahedra too flat to resist in a defined way: they contribute nothing. */
            flat_elements: number;
            /** @description Edges of a shell about which no face can turn, since rotations are held there. */
            held_edges: number;
            /**
             * Format: double
             * @description The mass of the object, in units of the input.
             */
            total_mass: number;
            /** @description Vertices that no sound element touches: they never move. */
            unattached: number;
            /** @description Vertices of the mesh. */
            vertices: number;
        };
        /**
         * @description What an index in a report counts.
         * @enum {string}
         */
        Element: "vertex" | "face" | "tetrahedron";
        /** @description What the approximation estimates of modes. */
        EstimatedModes: {
            /**
             * @description Whether none was skipped: only where exact modes stand in for approximate ones, of which some were lacking or
             *     too far off.
             */
            complete: boolean;
            /**
             * Format: double
             * @description The largest estimated relative error of a frequency.
             */
            estimated_error: number;
            /** @description Per mode. */
            estimated_errors: number[];
            /** @description Eigenvalues counted below shifts, of approximate modes near the last. */
            inertia: components["schemas"]["InertiaCount"][];
            /**
             * Format: int64
             * @description How often the modes were refined on the mesh.
             */
            inverse_iterations: number;
            /**
             * Format: int64
             * @description How many of those counted the approximate modes lack.
             */
            lacking: number;
        };
        /**
         * @description Faces that are spread evenly over a surface, the same in every request: each as far as possible from those before
         *     it, so that the first of many are the sample of few.
         */
        FaceSample: {
            /** @description How many; all faces where there are fewer. */
            sample: number;
        };
        /** @description Faces that an answer is about. */
        FacesRequest: components["schemas"]["FaceSample"] | number[];
        /**
         * @description How far the heat construction of fields goes.
         * @enum {string}
         */
        FieldAccuracy: "standard" | "accurate";
        /** @description How near the lowest approximate eigenfields come to what is usual. */
        FieldAccuracyReport: {
            /**
             * Format: double
             * @description The largest relative error of an eigenvalue that is usual on fair triangles.
             */
            goal: number;
            /**
             * Format: double
             * @description The largest estimated error, as a share of the exact eigenvalue, fields without energy apart.
             */
            largest_estimate: number;
            /**
             * @description Whether that is at most the goal. Where it is false, such fields are eigenfields of the space and not of the
             *     surface.
             */
            reached: boolean;
        };
        /** @description A stored basis. Of the kind `field_basis`. */
        FieldBasisBasisResource: components["schemas"]["FieldBasisBasisSummary"] & {
            /**
             * @description What is proven: per pair a residual and a bound; the defect of orthonormality; with `method: hsim` whether
             *     nothing was skipped. Of a field basis: of the lowest eigenvalues `estimates` of their errors, `bounds`, and
             *     whether they are as good as is usual, in `accuracy`. Null where nothing is.
             */
            certificate: components["schemas"]["FieldCertificate"] | null;
            /**
             * @description What only this kind of basis has. Of a field basis: `field` (its kind), `faces`, `numbers_per_face`,
             *     `dense_columns` (for the harmonic fields of handles), `nonzeros_per_row` and the `area` of the surface. Of maps:
             *     `bases`, `meshes` and `vertices` of the shapes, and how consistent they are, `cycles`. Of any kind, where a
             *     graphics card took part in it or failed to: `dense_solver`, a list of what solved its dense problems, and
             *     `measured_on`, of what measured its errors. Of eigenpairs, where a faster way was given up for a surer one:
             *     `fallbacks`, a list of what and why. Null where there is nothing of this.
             */
            details: components["schemas"]["FieldBasisDetails"];
            /** @description m eigenvalues, ascending, in 1/length² of the mesh. */
            eigenvalues: number[];
            /**
             * @description How the operator was made, and why: `laplacian` (`cotangent`, `robust`, `volume` or `graph`) with its `reason`,
             *     what was found of the mesh, how many vertices are no unknowns; of a solid also its `domain`, `solid` or
             *     `surface_of_solid`. Null where the kind has no such choice.
             */
            operator: Record<string, never> | null;
        } & {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "field_basis";
        };
        /** @description A stored basis without its eigenvalues and certificate, as lists have it. Of the kind `field_basis`. */
        FieldBasisBasisSummary: components["schemas"]["BasisFacts"] & {
            /**
             * @description The kind of job.
             * @enum {string}
             */
            kind: "field_basis";
            /** @description The mesh it lives on; null where it is of a problem. */
            mesh: string;
            parameters: components["schemas"]["FieldBasisParametersShown"];
        } & {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "field_basis";
        };
        /** @description What only a field basis has. */
        FieldBasisDetails: {
            /**
             * Format: double
             * @description The area of the surface, in squared units of the mesh.
             */
            area: number;
            /**
             * Format: int64
             * @description Columns that are not local, for the harmonic fields of handles.
             */
            dense_columns: number;
            /** @description What solved its dense problems; absent where no graphics card had to do with it. */
            dense_solver?: string[];
            /**
             * Format: int64
             * @description Faces of the surface.
             */
            faces: number;
            /** @description What is stored in a face. */
            field: components["schemas"]["FieldKind"];
            /**
             * Format: double
             * @description Entries of a row on average.
             */
            nonzeros_per_row: number;
            /**
             * Format: int64
             * @description Numbers in a face: 2, or 3 of a tensor.
             */
            numbers_per_face: number;
        };
        /** @description A job to be done. Of the kind `field_basis`. */
        FieldBasisJobRequest: {
            /**
             * @description The kind of job. (enum property replaced by openapi-typescript)
             * @enum {string}
             */
            kind: "field_basis";
            /** @description The id of the mesh. */
            mesh: string;
            /** @description Parameters; what is absent takes its default. */
            parameters?: components["schemas"]["FieldBasisParameters"];
            /**
             * Format: int32
             * @description Higher runs first. By default `0`.
             */
            priority?: number;
        };
        /** @description A job. Of the kind `field_basis`. */
        FieldBasisJobResource: components["schemas"]["JobFacts"] & {
            /**
             * @description The kind of job.
             * @enum {string}
             */
            kind: "field_basis";
            /** @description The mesh it works on; null where it works on a problem. */
            mesh: string;
            parameters: components["schemas"]["FieldBasisParametersShown"];
        } & {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "field_basis";
        };
        /** @description Every member that a job may have. What is absent is filled in. */
        FieldBasisParameters: {
            accuracy?: components["schemas"]["FieldAccuracy"] | null;
            boundary?: components["schemas"]["FieldBoundary"] | null;
            /** @description How they are constructed. By default `"heat"`. */
            construction?: components["schemas"]["FieldConstruction"];
            /**
             * @description The number of locally supported columns.
             * @example 2000
             */
            dimension?: number | null;
            /**
             * @description Of how many of the lowest eigenfields, besides those without energy, the errors are estimated: without it of 8,
             *     on surfaces of more than 270,000 faces of fewer. 0: of none.
             * @example 8
             */
            estimates?: number | null;
            /** @description Fields to derive the weights from: two or three numbers per face each, in the frames of the faces. */
            examples?: number[][] | null;
            /** @description What is stored in a face. By default `"vector"`. */
            field?: components["schemas"]["FieldName"];
            /** @description Whether spaces of vector fields carry the harmonic fields of the surface. */
            harmonic_fields?: boolean | null;
            heat?: components["schemas"]["FieldHeat"] | null;
            local_eigenfields?: components["schemas"]["LocalEigenfields"] | null;
            /**
             * Format: int32
             * @description The `n` of n-vectors.
             * @example 4
             */
            n?: number | null;
            /**
             * Format: int64
             * @description Draws the first sample.
             * @example 0
             */
            seed?: number | null;
            /**
             * Format: double
             * @description The radius of bumps or disks, in the place of the `sigma` of `heat` or `local_eigenfields`.
             * @example 8
             */
            sigma?: number | null;
            /** @description One positive weight per face. */
            weights?: number[] | null;
        };
        /** @description Every member that a job may have. What is absent is filled in. */
        FieldBasisParametersShown: {
            accuracy?: components["schemas"]["FieldAccuracy"] | null;
            boundary?: components["schemas"]["FieldBoundary"] | null;
            /** @description How they are constructed. */
            construction?: components["schemas"]["FieldConstruction"];
            /**
             * @description The number of locally supported columns.
             * @example 2000
             */
            dimension?: number | null;
            /**
             * @description Of how many of the lowest eigenfields, besides those without energy, the errors are estimated: without it of 8,
             *     on surfaces of more than 270,000 faces of fewer. 0: of none.
             * @example 8
             */
            estimates?: number | null;
            examples?: ((number[] | components["schemas"]["AbbreviatedList"])[] | null) | components["schemas"]["AbbreviatedList"];
            /** @description What is stored in a face. */
            field?: components["schemas"]["FieldName"];
            /** @description Whether spaces of vector fields carry the harmonic fields of the surface. */
            harmonic_fields?: boolean | null;
            heat?: components["schemas"]["FieldHeat"] | null;
            local_eigenfields?: components["schemas"]["LocalEigenfields"] | null;
            /**
             * Format: int32
             * @description The `n` of n-vectors.
             * @example 4
             */
            n?: number | null;
            /**
             * Format: int64
             * @description Draws the first sample.
             * @example 0
             */
            seed?: number | null;
            /**
             * Format: double
             * @description The radius of bumps or disks, in the place of the `sigma` of `heat` or `local_eigenfields`.
             * @example 8
             */
            sigma?: number | null;
            weights?: (number[] | null) | components["schemas"]["AbbreviatedList"];
        };
        /**
         * @description What fields of low energy do at a boundary.
         * @enum {string}
         */
        FieldBoundary: "tangential" | "normal" | "clamped";
        /** @description What is known of the lowest approximate eigenfields of a field basis. Lengths are those of the input. */
        FieldCertificate: {
            /** @description How near they come to what is usual. */
            accuracy: components["schemas"]["FieldAccuracyReport"];
            /**
             * @description For each of them: some exact eigenvalue lies within this of its eigenvalue, in 1/length², up to rounding; null
             *     where no such bound is known.
             */
            bounds: (number | null)[];
            /**
             * @description For each of the lowest eigenfields, as many as were judged, about how far its eigenvalue lies above the exact
             *     one of the same index, in 1/length².
             */
            estimates: number[];
        };
        /**
         * @description How columns are constructed.
         * @enum {string}
         */
        FieldConstruction: "heat" | "local_eigenfields";
        /** @description How columns are smoothed; lengths and times are relative to the surface of unit area and the number of samples `N`. */
        FieldHeat: {
            /**
             * @description Degree of the last smoothing; by default 6 for vector fields and 4 for others, which turn more from face to
             *     face: what is smoother than they are cannot follow them.
             */
            degree?: number | null;
            /**
             * Format: double
             * @description Lower end of what the last smoothing damps, of a spectrum that ends at 2. By default `0.15`.
             */
            least?: number;
            /**
             * Format: double
             * @description A column may spread beyond its bump by this multiple of `√(steps · time / N)`. By default `2.5`.
             */
            margin?: number;
            /**
             * Format: double
             * @description The radius of bumps is `√(σ / (π N))`. By default `8.0`.
             */
            sigma?: number;
            /** @description Implicit heat steps, at least 1. By default `2`. */
            steps?: number;
            /**
             * Format: double
             * @description Blocks of at most this magnitude become zero; by default .0056 for vector fields and .004 for others: some
             *     fifteen blocks stay for each face.
             */
            threshold?: number | null;
            /**
             * Format: double
             * @description The time of one step times `N`; by default .09 for vector fields and .08 for others.
             */
            time?: number | null;
            /**
             * Format: double
             * @description Relative residual at which the solve of a heat step ends. By default `0.015`.
             */
            tolerance?: number;
        };
        /** @description What is stored in a face. */
        FieldKind: components["schemas"]["FieldKindVector"] | components["schemas"]["FieldKindNVector"] | components["schemas"]["FieldKindTensor"];
        /**
         * @description `n` vectors, equal up to turns by 360°/n, as one representation vector: its angle is `n` times theirs. For
         *     `n = 1` a tangent vector. The operator carries vectors from face to face and weighs what differs as the thesis
         *     does; it is no discretisation of the connection Laplacian: on equal triangles its eigenvalues are twice those,
         *     and where triangles point one way they differ by direction.
         */
        FieldKindNVector: {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "n_vector";
            /**
             * Format: int32
             * @description How many, from 1.
             * @example 4
             */
            n: number;
        };
        /** @description A symmetric 2 × 2 tensor as `(a₁₁, a₂₂, √2 a₁₂)`. */
        FieldKindTensor: {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "tensor";
        };
        /** @description A tangent vector, with the Hodge–Laplacian. */
        FieldKindVector: {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "vector";
        };
        /** @description Links of a stored field. */
        FieldLinks: {
            /** @description The basis it was designed in; null of uploads. */
            basis: string | null;
            /** @description Its numbers. */
            content: string;
            /** @description Its mesh. */
            mesh: string;
            /** @description The field itself. */
            self: string;
        };
        /**
         * @description What is stored in a face.
         * @enum {string}
         */
        FieldName: "vector" | "n_vector" | "tensor";
        /**
         * @description A stored field.
         * @example {
         *       "basis": "019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10",
         *       "bytes": 46976,
         *       "columns": 2,
         *       "created_ms": 1795269602000,
         *       "design": {
         *         "alignment_energy": null,
         *         "biharmonic_energy": 122.4,
         *         "error": null,
         *         "field": {
         *           "kind": "vector"
         *         },
         *         "harmonic_energy": 4.81,
         *         "numbering": "file",
         *         "request": {
         *           "strokes": [
         *             {
         *               "direction": [
         *                 0,
         *                 0,
         *                 1
         *               ],
         *               "face": 17
         *             }
         *           ]
         *         }
         *       },
         *       "faces": 5856,
         *       "field": {
         *         "kind": "vector"
         *       },
         *       "id": "5c1f7e0a93b84d6f8e21a7b0c4d95f36",
         *       "links": {
         *         "basis": "/v1/bases/019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10",
         *         "content": "/v1/fields/5c1f7e0a93b84d6f8e21a7b0c4d95f36/content",
         *         "mesh": "/v1/meshes/0f6d2c4ab1e84cf29be2e3f0b5d1a7c3",
         *         "self": "/v1/fields/5c1f7e0a93b84d6f8e21a7b0c4d95f36"
         *       },
         *       "mesh": "0f6d2c4ab1e84cf29be2e3f0b5d1a7c3",
         *       "name": "combed back"
         *     }
         */
        FieldResource: components["schemas"]["FieldSummary"] & {
            design: components["schemas"]["SavedDesign"] | null;
        };
        /** @description Which field: exactly one of the four. */
        FieldSource: components["schemas"]["FieldSourceDesign"] | components["schemas"]["FieldSourceCoefficients"] | components["schemas"]["FieldSourceEigenfield"] | components["schemas"]["FieldSourceStored"];
        /** @description Coefficients that a design gave. */
        FieldSourceCoefficients: {
            /** @description Coefficients that a design gave. */
            coefficients: number[];
        };
        /** @description A field that is designed now. */
        FieldSourceDesign: {
            /** @description A field that is designed now. */
            design: components["schemas"]["DesignRequest"];
        };
        /** @description An approximate eigenfield, counted from 0. */
        FieldSourceEigenfield: {
            /** @description An approximate eigenfield, counted from 0. */
            eigenfield: number;
        };
        /** @description The id of a stored field on the same mesh: an upload, or a saved design. */
        FieldSourceStored: {
            /** @description The id of a stored field on the same mesh: an upload, or a saved design. */
            stored: string;
        };
        /** @description A stored field, as lists have it. */
        FieldSummary: {
            /** @description The basis it was designed in; null of uploads. */
            basis: string | null;
            /**
             * Format: int64
             * @description Bytes of the stored content.
             */
            bytes: number;
            /**
             * Format: int64
             * @description Numbers for each face, as they are kept: of a design those that are stored in a face.
             */
            columns: number;
            /**
             * Format: int64
             * @description When it was stored.
             */
            created_ms: number;
            /**
             * Format: int64
             * @description Faces of the mesh.
             */
            faces: number;
            field: components["schemas"]["FieldKind"] | null;
            /** @description 32 hexadecimal digits of the hash of all but the name: equal fields have an equal id. */
            id: string;
            /** @description Where to go from here. */
            links: components["schemas"]["FieldLinks"];
            /** @description The mesh it is on. */
            mesh: string;
            /** @description The name it was given. */
            name: string | null;
        };
        /** @description A table with a row for each face: itself, or the id of one that is stored. */
        FieldTable: components["schemas"]["Table"] | components["schemas"]["StoredField"];
        /** @description What a file has, and what became of its vertices. */
        FileSize: {
            /** @description Vertices of the file that have no counterpart in the mesh. */
            dropped: number;
            /** @description Faces of the file, a polygon counted once. */
            faces: number;
            /** @description Vertices of the file that became one with an earlier one. */
            merged: number;
            /** @description Vertices of the file. */
            vertices: number;
        };
        /**
         * @description What to filter, and how.
         * @example {
         *       "functions": "coordinates",
         *       "transfer": {
         *         "cutoff": 250,
         *         "kind": "low_pass"
         *       }
         *     }
         */
        FilterRequest: {
            /** @description `coordinates`, or a table with a row for each vertex. */
            functions: components["schemas"]["Functions"];
            /** @description By what each part is multiplied, as a function of its eigenvalue λ (1/length² of the mesh). */
            transfer: components["schemas"]["Transfer"];
        };
        /** @description Modes that are followed together, since eigenvalues lie close together in one basis or the other. */
        FollowedClusterAnswer: {
            /** @description Modes of the other basis, each at the place of the mode that it follows. */
            followers: number[];
            /** @description Modes of the reference, ascending. */
            modes: number[];
            /**
             * @description The orthogonal matrix that turns the functions of the followers to those of the modes: a row for each follower,
             *     a column for each mode.
             */
            rotation: components["schemas"]["Table"];
        };
        /** @description What follows a mode of the reference. */
        FollowedModeAnswer: {
            /** @description The mode of the other basis, counted from 0; null where the overlap is below a half. */
            mode: number | null;
            /**
             * Format: double
             * @description The cosine of the angle between the function and what follows it, in the mass of the reference; within a cluster
             *     after its rotation.
             */
            overlap: number;
            /**
             * Format: int32
             * @description 1, or −1 where that function has the other sign; within a cluster its rotation counts instead.
             */
            sign: number;
            /** @description Whether it follows for sure: its square is at least 0.8, so that no other has more than half of the overlap. */
            sure: boolean;
        };
        /** @description Modes of the reference, followed to the other basis. */
        FollowingAnswer: {
            /** @description Two and more modes that are followed together, by the first of them. */
            clusters: components["schemas"]["FollowedClusterAnswer"][];
            /** @description What follows each mode of the reference. */
            modes: components["schemas"]["FollowedModeAnswer"][];
        };
        /**
         * @description A map between two surfaces, and what tells how good it is.
         * @example {
         *       "carried": null,
         *       "commutativity_defect": 0.05,
         *       "confidences": [
         *         0.98,
         *         0.95
         *       ],
         *       "coverage": 0.8,
         *       "descriptor_residual": 0.1,
         *       "embedding_error": 0.1,
         *       "inverse": null,
         *       "matched": [
         *         0,
         *         3
         *       ],
         *       "matrix": {
         *         "columns": 2,
         *         "values": [
         *           1,
         *           0.01,
         *           -0.01,
         *           0.99
         *         ]
         *       },
         *       "orthogonality_defect": 0.2,
         *       "points": [
         *         5,
         *         9
         *       ]
         *     }
         */
        FunctionalMapAnswer: {
            carried: components["schemas"]["Table"] | null;
            /**
             * Format: double
             * @description ‖CΛ − Λ'C‖ / ‖CΛ‖: 0 for an isometry.
             */
            commutativity_defect: number;
            /**
             * @description For each of them how well its embedding x agrees with the image y of the vertex that corresponds to it: 1 − ‖x −
             *     y‖² / (‖x‖² + ‖y‖²), from 0 to 1; null where `points` is.
             */
            confidences: (number | null)[];
            /**
             * Format: double
             * @description The share of the source's area whose vertices were matched with.
             */
            coverage: number;
            /**
             * Format: double
             * @description ‖CA − B‖ / ‖B‖ of the first map: how well it takes the known functions to each other.
             */
            descriptor_residual: number;
            /**
             * Format: double
             * @description The root mean square of the distances between matched points in the spectral embedding, relative to its size.
             */
            embedding_error: number;
            inverse: components["schemas"]["Inverse"] | null;
            /** @description The vertices of the target that were matched; null: all of them, in order. */
            matched: number[] | null;
            /**
             * @description C, k × k: takes coefficients on the source to coefficients on the target, both surfaces scaled to unit area.
             *     Coefficients in the bases as they are stored are taken over by √(area of the target / area of the source) C.
             */
            matrix: components["schemas"]["Table"];
            /**
             * Format: double
             * @description ‖CᵀC − I‖ / √k: 0 for a map that preserves areas.
             */
            orthogonality_defect: number;
            /**
             * @description For each of them the vertex of the source that corresponds to it; null at vertices of the target's file that
             *     were dropped.
             */
            points: (number | null)[];
        };
        /**
         * @description Two surfaces, what is known of the map between them, and how it is refined.
         * @example {
         *       "landmarks": [
         *         [
         *           17,
         *           33
         *         ],
         *         [
         *           410,
         *           2930
         *         ],
         *         [
         *           1200,
         *           871
         *         ]
         *       ],
         *       "pairs": 100,
         *       "source": "019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10",
         *       "target": "019aa5d1-0c2b-7aa1-b7f4-5f0d6a1c2e33"
         *     }
         */
        FunctionalMapRequest: {
            /** @description Whether every vertex of the target is matched, or only those that stood for it. */
            all_points?: boolean;
            /** @description Whether vertices of the source are matched with some of the target as well, by a map of their own. */
            both_ways?: boolean;
            carry?: components["schemas"]["Carried"] | null;
            /**
             * Format: double
             * @description The weight of the preference for maps that commute with the Laplacians; 0.1 by default.
             */
            commutativity?: number | null;
            descriptors?: components["schemas"]["Descriptors"] | null;
            /** @description Pairs of a vertex of the source and the one of the target that it corresponds to. */
            landmarks?: number[][];
            /** @description The size of the refined map; 100 by default. */
            pairs?: number | null;
            /** @description Vertices of each surface that stand for it meanwhile; 2000 by default. */
            samples?: number | null;
            /**
             * @description Whether heat kernel signatures are used as such functions. They cannot tell the sides of a symmetric shape
             *     apart.
             */
            signatures?: boolean;
            /** @description The id of the basis on the source, where functions come from. */
            source: string;
            /** @description The size of the first map; 20 by default. */
            start?: number | null;
            /** @description By how much ZoomOut lets it grow at once; 5 by default. */
            step?: number | null;
            /** @description The id of the basis on the target, where they go to. */
            target: string;
        };
        /** @description How the operator of functions was made, and why. */
        FunctionOperator: components["schemas"]["OperatorReport"] & {
            /**
             * @description Of a solid: whether the basis is of its inside; absent for other meshes.
             * @enum {string}
             */
            domain?: "solid" | "surface_of_solid";
        };
        /** @description Functions on the vertices. */
        Functions: components["schemas"]["Named"] | components["schemas"]["Table"];
        /** @description A coat of fur: one straight strand for each face, or `strands` by area that bend. */
        FurRequest: {
            /**
             * Format: double
             * @description How much further strands lean at their tip than at their root, in radians: 0.5 where it is left out.
             */
            bend?: number | null;
            camera?: components["schemas"]["CameraRequest"] | null;
            /**
             * Format: double
             * @description How much tips gather in tufts, from 0 to 1: 0.35 where it is left out.
             */
            clump?: number | null;
            /** @description Downwards: `[0, -1, 0]` where it is left out. */
            down?: number[] | null;
            /** @description `{"design": …}`, `{"coefficients": […]}`, `{"eigenfield": k}` or `{"stored": id}`. */
            field: components["schemas"]["FieldSource"];
            /**
             * Format: double
             * @description The length of the field at which strands lean that far, above 0. By default `1.0`.
             */
            full?: number;
            /**
             * Format: double
             * @description How much they fall towards `down`, 0.15 where it is left out: 1 turns the tip of a strand that stands across as
             *     much downwards as it grows.
             */
            gravity?: number | null;
            /**
             * Format: double
             * @description The length of strands in the units of the mesh, above 0.
             */
            length: number;
            /** @description A factor of the length for each face, 0 or more. */
            lengths?: number[] | null;
            look?: components["schemas"]["HairRequest"] | null;
            /**
             * Format: double
             * @description How much strands differ, as a share of their length and of a radian: 0.15 where it is left out.
             */
            noise?: number | null;
            /** @description Points of a strand, its root first: 8 where it is left out. */
            points?: number | null;
            /**
             * Format: int64
             * @description The seed of places and differences: the same one gives the same coat.
             */
            seed?: number | null;
            /** @description So many strands, spread by area; in pictures 200,000 where it is left out. All that follows belongs to them. */
            strands?: number | null;
            /**
             * Format: double
             * @description How far strands lean at most, in radians from the normal, up to π. By default `1.0`.
             */
            tilt?: number;
        };
        /** @description How a picture of fur looks. */
        HairRequest: {
            /** @description Red, green and blue behind the fur: white where it is left out. */
            background?: number[] | null;
            /** @description Red, green and blue from 0 to 1. */
            colour?: number[] | null;
            /** @description Towards the light: above the left shoulder of who looks where it is left out. */
            light?: number[] | null;
            /**
             * Format: double
             * @description The width of strands at their root, in the units of the mesh: as much as covers the surface where it is left
             *     out.
             */
            thickness?: number | null;
        };
        /**
         * @description A hatching.
         * @example {
         *       "lines": [
         *         {
         *           "faces": [
         *             17
         *           ],
         *           "level": 0,
         *           "points": [
         *             [
         *               0.1,
         *               0.2,
         *               0.3
         *             ],
         *             [
         *               0.11,
         *               0.2,
         *               0.3
         *             ]
         *           ]
         *         }
         *       ]
         *     }
         */
        HatchingAnswer: {
            /** @description The lines, in the order in which they were laid. */
            lines: components["schemas"]["Line"][];
        };
        /** @description How lines are laid and drawn. */
        HatchingRequest: {
            camera?: components["schemas"]["CameraRequest"] | null;
            /** @description `{"design": …}`, `{"coefficients": […]}`, `{"eigenfield": k}` or `{"stored": id}`. */
            field: components["schemas"]["FieldSource"];
            /**
             * Format: double
             * @description Shorter lines are left out, in multiples of the spacing. By default `2.0`.
             */
            least_length?: number | null;
            /**
             * Format: int32
             * @description Levels of lines, each at half the distance of the one before, the last at the spacing: of drawings with a tone 3
             *     where it is left out, otherwise 1.
             */
            levels?: number | null;
            /** @description Lines at most. By default `100000`. */
            most_lines?: number | null;
            /**
             * Format: double
             * @description The width of silhouettes, creases and boundaries in a drawing, in widths of the pen; 0 leaves them out. By default `1.6`.
             */
            outline?: number;
            /** @description Whether lines of a drawing swell where it is darker, or all have the width of the pen, for plotters. */
            pen?: components["schemas"]["Pen"];
            /**
             * Format: double
             * @description The distance between lines, in units of the square root of the surface's area: of lines 0.01 where it is left
             *     out, of drawings four widths of the pen.
             */
            spacing?: number | null;
            /**
             * Format: double
             * @description The width of the pen in a drawing, in pixels. By default `1.0`.
             */
            stroke?: number;
            tone?: components["schemas"]["ToneRequest"] | null;
        };
        /**
         * @description Whether the process answers.
         * @example {
         *       "status": "ok",
         *       "version": "0.1.0"
         *     }
         */
        Health: {
            /** @description `ok`. */
            status: string;
            /** @description The version of the server. */
            version: string;
        };
        /** @description How columns are smoothed; lengths and times are relative to the surface of unit area and the number of columns `d`. */
        HeatParameters: {
            /**
             * Format: double
             * @description Entries below this are dropped after the diffusion. By default `0.0001`.
             */
            drop?: number;
            /**
             * Format: double
             * @description A column may spread beyond its support by this multiple of `√(steps · time / d)`. By default `2.5`.
             */
            margin?: number;
            /** @description Implicit heat steps, at least 1. By default `4`. */
            steps?: number;
            /**
             * Format: double
             * @description Entries at or below this become zero, larger ones `x` become `(x − threshold)²/x`. By default `0.003`.
             */
            threshold?: number;
            /**
             * Format: double
             * @description The time of one step times `d`. By default `0.05`.
             */
            time?: number;
            /**
             * Format: double
             * @description Relative residual at which the solve of a heat step ends. By default `0.003`.
             */
            tolerance?: number;
        };
        /** @description Eigenvalues counted below shifts. */
        HodgeInertia: {
            /** @description Of co-gradients. */
            co_gradients: components["schemas"]["InertiaCount"][];
            /** @description Of gradients. */
            gradients: components["schemas"]["InertiaCount"][];
        };
        /** @description How the Hodge–Laplacian was made. */
        HodgeOperator: {
            /**
             * @description `surface_of_solid`, where the mesh is one; absent for other meshes.
             * @enum {string}
             */
            domain?: "solid" | "surface_of_solid";
            /** @description What the fields are. */
            hodge: components["schemas"]["HodgeReport"];
            /**
             * Format: int64
             * @description Faces without an area.
             */
            zero_area_faces: number;
        };
        /** @description What the eigenfields are, and how they were counted. */
        HodgeReport: {
            /**
             * Format: int64
             * @description Co-gradients.
             */
            co_gradients: number;
            /**
             * Format: int64
             * @description Gradients.
             */
            gradients: number;
            /**
             * Format: int64
             * @description Harmonic fields.
             */
            harmonic: number;
            /** @description The counts of the two scalar spectra. */
            inertia: components["schemas"]["HodgeInertia"];
            /** @description What each field is. */
            parts: ("harmonic" | "gradient" | "co_gradient")[];
        };
        /**
         * @description How the hierarchical method goes about it.
         * @enum {string}
         */
        HsimVariant: "sliced" | "published";
        /** @description An inertia count (Sylvester): how many eigenvalues lie below a shift. */
        InertiaCount: {
            /** @description Eigenvalues below it, with multiplicity. */
            below: number;
            /**
             * Format: double
             * @description The shift, in 1/length² of the input.
             */
            shift: number;
        };
        /** @description In which state an object is at time 0. */
        InitialRequest: components["schemas"]["InitialRequestState"] | components["schemas"]["InitialRequestVertices"];
        /** @description In coordinates of the modes. */
        InitialRequestState: {
            /** @description In coordinates of the modes. */
            state: components["schemas"]["ModalState"];
        };
        /**
         * @description By a vector for each vertex, or none for zeros. What no mode holds is left out, and told. Vertices of a file
         *     that were dropped may have `null`, as in answers, in place of a vector or of its numbers.
         */
        InitialRequestVertices: {
            vertices: components["schemas"]["InitialRequestVerticesMembers"];
        };
        /**
         * @description By a vector for each vertex, or none for zeros. What no mode holds is left out, and told. Vertices of a file
         *     that were dropped may have `null`, as in answers, in place of a vector or of its numbers.
         */
        InitialRequestVerticesMembers: {
            /** @description How far it is displaced, in units of the mesh. */
            displacements?: ((number | null)[] | null)[] | null;
            /** @description How fast it moves. */
            velocities?: ((number | null)[] | null)[] | null;
        };
        /** @description Bounds on the eigenvalues that were asked for, in 1/length² of the input. */
        Interval: {
            /**
             * Format: double
             * @description The lower bound, which belongs to the interval; absent where there is none.
             */
            from?: number | null;
            /** @description Pairs of which rounding does not let one tell on which side of a bound they lie, delivered or not. */
            on_bounds: components["schemas"]["OnBound"][];
            /**
             * Format: double
             * @description The upper bound, which does not.
             */
            to: number;
        };
        /** @description For vertices of the source those of the target. */
        Inverse: {
            /** @description For each of them how well the two agree, from 0 to 1; null where `points` is. */
            confidences: (number | null)[];
            /** @description The vertices of the source that were matched; null: all of them, in order. */
            matched: number[] | null;
            /**
             * @description For each of them the vertex of the target that corresponds to it; null at vertices of the source's file that
             *     were dropped.
             */
            points: (number | null)[];
        };
        /**
         * @description What a job would take.
         * @example {
         *       "fits": true,
         *       "kind": "eigenbasis",
         *       "memory_bytes": 1210056704,
         *       "memory_limit_bytes": 8589934592,
         *       "seconds": 4.2,
         *       "threads": 2
         *     }
         */
        JobEstimate: {
            /** @description Whether it is allowed so much; a job that is not is refused. */
            fits: boolean;
            /** @description The kind of job. */
            kind: string;
            /**
             * Format: int64
             * @description About how much memory it needs, in bytes: an upper estimate for surfaces, and for problems, whose factor was
             *     counted. Pairs by a bound count as `at_most`. Of an approximation in parts, what it takes to plan and join them,
             *     or what one of them takes.
             */
            memory_bytes: number;
            /**
             * Format: int64
             * @description What this server allows for one job, in bytes.
             */
            memory_limit_bytes: number;
            /**
             * Format: double
             * @description About how many seconds of one core, right to a factor of two on a recent processor; `null` for what nobody has
             *     fitted, as pairs by a bound. Waiting in the queue comes on top, and more threads shorten it.
             */
            seconds: number | null;
            /** @description The threads that work on it. */
            threads: number;
        };
        /** @description A job. */
        JobFacts: {
            /**
             * Format: int32
             * @description The attempt that runs or ran last; 0 before the first.
             */
            attempt: number;
            /** @description The id of the basis it made. */
            basis: string | null;
            /** @description Whether it was asked to stop. */
            cancel_requested: boolean;
            /**
             * Format: int64
             * @description When it was submitted.
             */
            created_ms: number;
            /** @description Where it stands within the stage, in words: `level 2 of 3, iteration 1, slice 4 of 8`. */
            detail: string | null;
            /**
             * Format: int64
             * @description When it ended.
             */
            finished_ms: number | null;
            /** @description A time-ordered UUID. */
            id: string;
            /** @description Where to go from here. */
            links: components["schemas"]["JobLinks"];
            /**
             * Format: int32
             * @description How often it is tried at most.
             */
            max_attempts: number;
            /**
             * Format: int64
             * @description An estimate of the memory it needs: jobs that together need more than the server has do not run at once. It
             *     grows where a job in parts turns out to be done in one piece.
             */
            memory_bytes: number;
            /** @description Of a part, the job that it is a part of; null for others. */
            parent: string | null;
            /**
             * @description Of a job that is divided, how many of its parts are done, of all; null where it is not. It waits for them as
             *     `enqueued`, in the stage `parts`.
             */
            parts: {
                /**
                 * Format: int32
                 * @description How many are done.
                 */
                done: number;
                /**
                 * Format: int32
                 * @description Of so many.
                 */
                of: number;
            } | null;
            /**
             * Format: int32
             * @description Higher runs first.
             */
            priority: number;
            problem: components["schemas"]["JobProblemResource"] | null;
            /**
             * Format: double
             * @description The fraction of the stage that is done, from 0 to 1.
             */
            progress: number | null;
            /**
             * Format: int64
             * @description Grows with every change.
             */
            revision: number;
            /** @description The version of the solver. */
            solver_version: string;
            /** @description The stage that runs. */
            stage: string | null;
            /** @description Seconds spent in each stage of the last attempt, in order. */
            stage_seconds: components["schemas"]["StageSeconds"][];
            /**
             * Format: int64
             * @description When its last attempt began.
             */
            started_ms: number | null;
            /** @description Where it stands. */
            status: components["schemas"]["Status"];
        };
        /** @description Links of a job. */
        JobLinks: {
            /** @description Its basis, once there is one. */
            basis: string | null;
            /** @description Its changes, as server-sent events. */
            events: string;
            /** @description Its mesh; null where it has none. */
            mesh: string | null;
            /** @description The jobs that solve its parts, while it is divided; null where it is not. */
            parts: string | null;
            /** @description Its problem, of the kind `pencil_basis`; null for others. */
            pencil: string | null;
            /** @description The job itself. */
            self: string;
        };
        /** @description Why a job failed, in the form of RFC 9457. */
        JobProblemResource: {
            /** @description A sentence that names the offending element. */
            detail: string;
            /** @description A short summary. */
            title: string;
            /** @description A stable URI. */
            type: string;
        };
        /**
         * @description A job to be done.
         * @example {
         *       "kind": "eigenbasis",
         *       "mesh": "0f6d2c4ab1e84cf29be2e3f0b5d1a7c3",
         *       "parameters": {
         *         "count": 500,
         *         "method": "approximate"
         *       },
         *       "priority": 0
         *     }
         */
        JobRequest: components["schemas"]["EigenbasisJobRequest"] | components["schemas"]["FieldBasisJobRequest"] | components["schemas"]["OperatorFamilyJobRequest"] | components["schemas"]["VibrationBasisJobRequest"] | components["schemas"]["PencilBasisJobRequest"] | components["schemas"]["MapCollectionJobRequest"];
        /**
         * @description A job.
         * @example {
         *       "attempt": 1,
         *       "basis": null,
         *       "cancel_requested": false,
         *       "created_ms": 1795269600000,
         *       "detail": null,
         *       "finished_ms": null,
         *       "id": "019aa5d0-5c3e-7c11-8a53-3a0f1c7ce1f2",
         *       "kind": "eigenbasis",
         *       "links": {
         *         "basis": null,
         *         "events": "/v1/jobs/019aa5d0-5c3e-7c11-8a53-3a0f1c7ce1f2/events",
         *         "mesh": "/v1/meshes/0f6d2c4ab1e84cf29be2e3f0b5d1a7c3",
         *         "parts": null,
         *         "pencil": null,
         *         "self": "/v1/jobs/019aa5d0-5c3e-7c11-8a53-3a0f1c7ce1f2"
         *       },
         *       "max_attempts": 3,
         *       "memory_bytes": 1283457000,
         *       "mesh": "0f6d2c4ab1e84cf29be2e3f0b5d1a7c3",
         *       "parameters": {
         *         "accuracy": "standard",
         *         "boundary": "neumann",
         *         "construction": "heat",
         *         "count": 500,
         *         "dimension": 1000,
         *         "mass": "barycentric",
         *         "method": "approximate",
         *         "operator": "auto",
         *         "seed": 0
         *       },
         *       "parent": null,
         *       "parts": null,
         *       "priority": 0,
         *       "problem": null,
         *       "progress": 0.4,
         *       "revision": 7,
         *       "solver_version": "0.1.0+5",
         *       "stage": "basis",
         *       "stage_seconds": [
         *         {
         *           "seconds": 0.031,
         *           "stage": "operator"
         *         },
         *         {
         *           "seconds": 0.022,
         *           "stage": "sampling"
         *         }
         *       ],
         *       "started_ms": 1795269600012,
         *       "status": "processing"
         *     }
         */
        JobResource: components["schemas"]["EigenbasisJobResource"] | components["schemas"]["FieldBasisJobResource"] | components["schemas"]["OperatorFamilyJobResource"] | components["schemas"]["VibrationBasisJobResource"] | components["schemas"]["PencilBasisJobResource"] | components["schemas"]["MapCollectionJobResource"] | components["schemas"]["EigenbasisPartJobResource"];
        /**
         * @description How the Laplacian is made.
         * @enum {string}
         */
        Laplacian: "cotangent" | "polygon" | "robust" | "volume" | "graph";
        /** @description What one level of the hierarchy took. */
        LevelReport: {
            /** @description The size of the level's eigenproblem. */
            dimension: number;
            /** @description Iterations, each with one Rayleigh–Ritz; 0 for a level that is solved directly. */
            iterations: number;
            /** @description Shifts that were factored. */
            shifts: number;
        };
        /** @description A lifted field. */
        LiftedField: {
            /** @description Numbers per face. */
            columns: number;
            /** @description The faces, where the request has `faces`; otherwise all, in their order. */
            faces: number[] | null;
            /**
             * @description How it is written.
             * @example world
             */
            form: string;
            /** @description Values, face after face. */
            values: number[];
        };
        /** @description A line on the surface. */
        Line: {
            /** @description The face that each piece lies in: one fewer than points. */
            faces: number[];
            /**
             * Format: int32
             * @description Its level, counted from 0.
             */
            level: number;
            /** @description Its points in the units of the mesh: one for each edge that it crosses, and its ends. */
            points: number[][];
        };
        /** @description What acts on one vertex, or on all that has mass. */
        LoadRequest: components["schemas"]["LoadRequestImpulse"] | components["schemas"]["LoadRequestForce"] | components["schemas"]["LoadRequestBody"];
        /** @description A constant acceleration of the whole object, as by its weight. */
        LoadRequestBody: {
            body: components["schemas"]["LoadRequestBodyMembers"];
        };
        /** @description A constant acceleration of the whole object, as by its weight. */
        LoadRequestBodyMembers: {
            /** @description In length / time². */
            acceleration: number[];
            /**
             * Format: double
             * @description Since when.
             */
            from?: number;
            /**
             * Format: double
             * @description Until when; without it, for ever.
             */
            to?: number | null;
        };
        /** @description A constant force over an interval. */
        LoadRequestForce: {
            force: components["schemas"]["LoadRequestForceMembers"];
        };
        /** @description A constant force over an interval. */
        LoadRequestForceMembers: {
            /** @description In mass · length / time². */
            force: number[];
            /**
             * Format: double
             * @description Since when.
             */
            from: number;
            /**
             * Format: double
             * @description Until when.
             */
            to: number;
            /** @description Where. */
            vertex: number;
        };
        /** @description A sudden change of momentum: a tap. */
        LoadRequestImpulse: {
            impulse: components["schemas"]["LoadRequestImpulseMembers"];
        };
        /** @description A sudden change of momentum: a tap. */
        LoadRequestImpulseMembers: {
            /** @description By how much, in mass · length / time. */
            momentum: number[];
            /**
             * Format: double
             * @description When.
             */
            time?: number;
            /** @description Where. */
            vertex: number;
        };
        /** @description How local eigenfields are computed. */
        LocalEigenfields: {
            /** @description Inverse iterations, from the frame of the centre carried along and damped towards the rim. By default `2`. */
            iterations?: number;
            /**
             * Format: double
             * @description The radius of disks on the surface is `√(σ · area / (π d))`: about σ numbers a row. By default `40.0`.
             */
            sigma?: number;
        };
        /**
         * @description A map between the numbering of a file and that of its mesh.
         * @example {
         *       "file": 5,
         *       "identical": false,
         *       "kept": 4,
         *       "known": true,
         *       "map": [
         *         0,
         *         1,
         *         null,
         *         2,
         *         3
         *       ],
         *       "of": "file"
         *     }
         */
        MapAnswer: {
            /** @description How many the file has. */
            file: number;
            /** @description Whether both numberings are the same. */
            identical: boolean;
            /** @description How many the mesh has; of a solid, the vertices inside too, which follow those of its surface. */
            kept: number;
            /**
             * @description Whether the numbering of the file is known. It is not of a mesh that was stored, and renumbered, before maps
             *     were kept: its own numbering stands for it then; upload the file again to have its map.
             */
            known: boolean;
            /** @description For each the number on the other side, or null where it has none. Several on the other side: the first. */
            map: (number | null)[];
            /**
             * @description What there is an entry for.
             * @enum {string}
             */
            of: "file" | "kept";
        };
        /**
         * @description Maps between all shapes, both ways.
         * @example {
         *       "cycles": {
         *         "largest": 0.01,
         *         "pairs": 0.01,
         *         "triples": null
         *       },
         *       "maps": [
         *         {
         *           "confidences": [
         *             0.98,
         *             0.95
         *           ],
         *           "disagreement": 0.1,
         *           "matrix": null,
         *           "points": [
         *             5,
         *             9
         *           ],
         *           "source": 0,
         *           "target": 1
         *         },
         *         {
         *           "confidences": [
         *             0.97,
         *             0.91
         *           ],
         *           "disagreement": 0.1,
         *           "matrix": null,
         *           "points": [
         *             7,
         *             2
         *           ],
         *           "source": 1,
         *           "target": 0
         *         }
         *       ]
         *     }
         */
        MapCollectionAnswer: {
            /** @description How consistent they are. */
            cycles: {
                /**
                 * Format: double
                 * @description The largest mean of a single walk.
                 */
                largest: number;
                /**
                 * Format: double
                 * @description There and back, the mean over all pairs.
                 */
                pairs: number;
                /**
                 * Format: double
                 * @description Over two other shapes, the mean over all triples; null for two shapes.
                 */
                triples: number | null;
            };
            /** @description A map for each ordered pair of shapes: by source, then by target. */
            maps: components["schemas"]["MapOfCollection"][];
        };
        /** @description A stored basis. Of the kind `map_collection`. */
        MapCollectionBasisResource: components["schemas"]["MapCollectionBasisSummary"] & {
            /**
             * @description What is proven: per pair a residual and a bound; the defect of orthonormality; with `method: hsim` whether
             *     nothing was skipped. Of a field basis: of the lowest eigenvalues `estimates` of their errors, `bounds`, and
             *     whether they are as good as is usual, in `accuracy`. Null where nothing is.
             */
            certificate: Record<string, never> | null;
            /**
             * @description What only this kind of basis has. Of a field basis: `field` (its kind), `faces`, `numbers_per_face`,
             *     `dense_columns` (for the harmonic fields of handles), `nonzeros_per_row` and the `area` of the surface. Of maps:
             *     `bases`, `meshes` and `vertices` of the shapes, and how consistent they are, `cycles`. Of any kind, where a
             *     graphics card took part in it or failed to: `dense_solver`, a list of what solved its dense problems, and
             *     `measured_on`, of what measured its errors. Of eigenpairs, where a faster way was given up for a surer one:
             *     `fallbacks`, a list of what and why. Null where there is nothing of this.
             */
            details: components["schemas"]["MapCollectionDetails"];
            /** @description m eigenvalues, ascending, in 1/length² of the mesh. */
            eigenvalues: number[];
            /**
             * @description How the operator was made, and why: `laplacian` (`cotangent`, `robust`, `volume` or `graph`) with its `reason`,
             *     what was found of the mesh, how many vertices are no unknowns; of a solid also its `domain`, `solid` or
             *     `surface_of_solid`. Null where the kind has no such choice.
             */
            operator: Record<string, never> | null;
        } & {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "map_collection";
        };
        /** @description A stored basis without its eigenvalues and certificate, as lists have it. Of the kind `map_collection`. */
        MapCollectionBasisSummary: components["schemas"]["BasisFacts"] & {
            /**
             * @description The kind of job.
             * @enum {string}
             */
            kind: "map_collection";
            /** @description The mesh it lives on; null where it is of a problem. */
            mesh: string;
            parameters: components["schemas"]["MapCollectionParameters"];
        } & {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "map_collection";
        };
        /** @description What only maps between shapes have. */
        MapCollectionDetails: {
            /** @description The bases of the shapes, in their order. */
            bases: string[];
            /** @description How consistent the maps are. */
            cycles: {
                /**
                 * Format: double
                 * @description The largest mean of a single walk.
                 */
                largest: number;
                /**
                 * Format: double
                 * @description There and back, the mean over all pairs.
                 */
                pairs: number;
                /**
                 * Format: double
                 * @description Over two other shapes, the mean over all triples; null for two shapes.
                 */
                triples: number | null;
            };
            /** @description What solved its dense problems; absent where no graphics card had to do with it. */
            dense_solver?: string[];
            /** @description Their meshes. */
            meshes: string[];
            /** @description The vertices of each. */
            vertices: number[];
        };
        /** @description A job to be done. Of the kind `map_collection`. */
        MapCollectionJobRequest: {
            /** @description Of the kind `map_collection`, in the place of a mesh: the ids of the bases, one for each shape. */
            bases: string[];
            /**
             * @description The kind of job. (enum property replaced by openapi-typescript)
             * @enum {string}
             */
            kind: "map_collection";
            /** @description Parameters; what is absent takes its default. */
            parameters?: components["schemas"]["MapCollectionParameters"];
            /**
             * Format: int32
             * @description Higher runs first. By default `0`.
             */
            priority?: number;
        };
        /** @description A job. Of the kind `map_collection`. */
        MapCollectionJobResource: components["schemas"]["JobFacts"] & {
            /** @description The bases it works on, of the kind `map_collection` alone; `mesh` is that of the first. */
            bases: string[];
            /**
             * @description The kind of job.
             * @enum {string}
             */
            kind: "map_collection";
            /** @description The mesh it works on; null where it works on a problem. */
            mesh: string;
            parameters: components["schemas"]["MapCollectionParameters"];
        } & {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "map_collection";
        };
        /** @description How shapes are mapped to each other. Defaults that depend on the shapes are filled in when these are known. */
        MapCollectionParameters: {
            /**
             * @description Whether maps keep the orientation that the faces of the meshes give. Without it nothing tells the sides of a
             *     symmetric shape apart. By default `true`.
             */
            oriented?: boolean;
            /**
             * @description The size of the refined maps: 100, or as many pairs as all bases have, unless it is given. Shapes times pairs
             *     are at most 4,096.
             * @example 60
             */
            pairs?: number | null;
            /** @description Whether each pair is refined by itself at the end: nearer to the truth, and a little less consistent. By default `true`. */
            polish?: boolean;
            /**
             * @description Vertices of each surface that stand for it while maps are refined: at least twice the pairs. By default `2000`.
             * @example 2000
             */
            samples?: number;
            /**
             * @description The size of the first maps: 30, or as many as the refined maps have, unless it is given.
             * @example 30
             */
            start?: number | null;
            /**
             * @description By how much maps grow at once. By default `5`.
             * @example 5
             */
            step?: number;
        };
        /**
         * @description Which shapes, and how they are mapped.
         * @example {
         *       "bases": [
         *         "019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10",
         *         "019aa5d1-0c2b-7aa1-b7f4-5f0d6a1c2e33"
         *       ],
         *       "pairs": 100
         *     }
         */
        MapCollectionRequest: {
            /** @description The ids of the bases, one for each shape: 2 to 32, of different meshes. */
            bases: string[];
            /** @description Whether the answer has the matrices beside the points. */
            matrices?: boolean;
            /**
             * @description Whether maps keep the orientation that the faces of the meshes give. Without it nothing tells the sides of a
             *     symmetric shape apart. By default `true`.
             */
            oriented?: boolean;
            /**
             * @description The size of the refined maps; 100 by default, or as many as all bases have. Shapes times pairs are at most
             *     4,096.
             */
            pairs?: number | null;
            /** @description Whether each pair is refined by itself at the end: nearer to the truth, and a little less consistent. By default `true`. */
            polish?: boolean;
            /** @description Vertices of each surface that stand for it meanwhile; 2000 by default. */
            samples?: number | null;
            /** @description The size of the first maps; 30 by default. */
            start?: number | null;
            /** @description By how much they grow at once; 5 by default. */
            step?: number | null;
        };
        /** @description The map from one shape to another. */
        MapOfCollection: {
            /** @description For each of them how well the two agree in the latent space, from 0 to 1; null where `points` is. */
            confidences: (number | null)[];
            /**
             * Format: double
             * @description How far the map that the points of this pair alone made was from what the collection agrees on: 0 for none.
             */
            disagreement: number;
            matrix: components["schemas"]["Table"] | null;
            /**
             * @description For each vertex of the target the vertex of the source that corresponds to it; null at vertices of the target's
             *     file that were dropped.
             */
            points: (number | null)[];
            /** @description The place in `bases` of the shape where functions come from. */
            source: number;
            /** @description The place of the shape where they go to. */
            target: number;
        };
        /**
         * @description Which mass matrix the hat functions get (`numerics`: per face of area A).
         * @enum {string}
         */
        MassKind: "consistent" | "barycentric" | "voronoi";
        /** @description Two neighbouring faces between which a field does not turn by the least angle. */
        MatchedFaces: {
            /** @description The faces. */
            faces: number[];
            /**
             * Format: int32
             * @description Full turns of the representation from the first face to the second, beyond the least angle: of n directions
             *     number k goes on as the `turns` next one after that which is nearest to it.
             */
            turns: number;
        };
        /** @description What an object is made of: a homogeneous isotropic material. */
        Material: {
            /**
             * Format: double
             * @description Mass per volume, in kg/m³ if lengths are in metres. By default `7800.0`.
             * @example 7800
             */
            density?: number;
            /**
             * Format: double
             * @description Poisson's ratio, −0.9 to 0.49. By default `0.3`.
             * @example 0.3
             */
            poisson?: number;
            /**
             * Format: double
             * @description Young's modulus, in pascal if lengths are in metres. By default `200000000000.0`.
             * @example 200000000000
             */
            young?: number;
        };
        /**
         * @description A mesh as arrays; vertices are counted from 0.
         * @example {
         *       "faces": [
         *         [
         *           0,
         *           1,
         *           2
         *         ]
         *       ],
         *       "vertices": [
         *         [
         *           0,
         *           0,
         *           0
         *         ],
         *         [
         *           1,
         *           0,
         *           0
         *         ],
         *         [
         *           0,
         *           1,
         *           0
         *         ]
         *       ]
         *     }
         */
        MeshArrays: {
            /** @description Faces: the vertices of each, three or more. */
            faces?: number[][];
            /** @description Tetrahedra: four vertices of each. */
            tetrahedra?: number[][];
            /** @description Positions: x, y and z of each vertex. */
            vertices: number[][];
        };
        /** @description Links of a mesh. */
        MeshLinks: {
            /** @description Its content. */
            content: string;
            /** @description The fields that are stored on it. */
            fields: string;
            /** @description The mesh itself. */
            self: string;
        };
        /** @description A mesh in parts; all but the first may stand in the query instead, which decides where both say something. */
        MeshParts: {
            /** @description As in the query. */
            format?: string;
            /**
             * @description As in the query.
             * @enum {string}
             */
            merge?: "auto" | "always" | "never";
            /**
             * Format: binary
             * @description The file.
             */
            mesh: Blob;
            /** @description As in the query. */
            name?: string;
            /**
             * Format: int32
             * @description As in the query.
             */
            subdivide?: number;
            /**
             * @description As in the query.
             * @enum {string}
             */
            surface?: "boundary" | "given";
        };
        /**
         * @description What is known about a triangle mesh after it was checked and repaired.
         *
         *     Counts and topology describe the mesh as it will be used, after the repairs. Defects describe the mesh as it was
         *     given.
         */
        MeshReport: {
            /**
             * Format: double
             * @description Total area, in squared units of the input.
             */
            area: number;
            attributes?: components["schemas"]["AttributeReport"] | null;
            /** @description Edges with one face. */
            boundary_edges: number;
            /**
             * @description Closed chains of boundary edges, followed around one fan of faces at a time. A chain that ends at a non-manifold
             *     edge counts as one.
             */
            boundary_loops: number;
            /** @description The least and the greatest coordinates, in units of the input; zeros where no vertex is finite. */
            bounding_box: number[][];
            /** @description Whether there are faces and every edge has at least two. */
            closed: boolean;
            /**
             * @description Connected components, joined through vertices: the dimension of the kernel of the stiffness matrix, as long as
             *     no part hangs on by zero-area faces alone.
             */
            components: number;
            /**
             * @description What is wrong with the mesh as given, by kind; kinds that do not occur are left out. Edges that only copies of
             *     faces make non-manifold are none.
             */
            defects: components["schemas"]["Defect"][];
            /** @description Edges: pairs of vertices that some face joins. */
            edges: number;
            /**
             * Format: int64
             * @description `χ = n − edges + f`.
             */
            euler_characteristic: number;
            /** @description Faces, `f`. */
            faces: number;
            file?: components["schemas"]["FileSize"] | null;
            /**
             * Format: int64
             * @description The genus of each component, summed: `components − (χ + boundary_loops) / 2`. `None` unless the mesh is manifold
             *     and orientable.
             */
            genus: number | null;
            /** @description Whether every edge has at most two faces and the faces around every vertex form one fan. */
            manifold: boolean;
            /**
             * @description Whether the faces can be turned so that the two faces of every manifold edge run along it in opposite
             *     directions.
             */
            orientable: boolean;
            /**
             * @description Whether the file has points without faces. Area and components are then those of the triangles that are made
             *     around each point.
             */
            points?: boolean;
            /**
             * @description Polygons of more than three corners that keep their shape: the Laplacian is made of them, not of the triangles
             *     that they were cut into.
             */
            polygons?: number;
            /**
             * @description What was done about it; none of it loses anything, but for `LeftOutTetrahedra`, which is done on
             *     request alone.
             */
            repairs: components["schemas"]["Repair"][];
            solid?: components["schemas"]["SolidReport"] | null;
            /**
             * Format: int32
             * @description How often every face was divided into four.
             */
            subdivisions?: number;
            surface?: components["schemas"]["SurfaceOf"] | null;
            /** @description Vertices, `n`. */
            vertices: number;
        };
        /**
         * @description A stored mesh.
         * @example {
         *       "bytes": 140592,
         *       "created_ms": 1795269600000,
         *       "faces": 5856,
         *       "format": "obj",
         *       "id": "0f6d2c4ab1e84cf29be2e3f0b5d1a7c3",
         *       "links": {
         *         "content": "/v1/meshes/0f6d2c4ab1e84cf29be2e3f0b5d1a7c3/content",
         *         "fields": "/v1/fields?mesh=0f6d2c4ab1e84cf29be2e3f0b5d1a7c3",
         *         "self": "/v1/meshes/0f6d2c4ab1e84cf29be2e3f0b5d1a7c3"
         *       },
         *       "name": "spot",
         *       "report": {
         *         "area": 5.49,
         *         "boundary_edges": 0,
         *         "boundary_loops": 0,
         *         "bounding_box": [
         *           [
         *             -0.48,
         *             -0.74,
         *             -1
         *           ],
         *           [
         *             0.48,
         *             0.94,
         *             0.99
         *           ]
         *         ],
         *         "closed": true,
         *         "components": 1,
         *         "defects": [],
         *         "edges": 8784,
         *         "euler_characteristic": 2,
         *         "faces": 5856,
         *         "genus": 0,
         *         "manifold": true,
         *         "orientable": true,
         *         "repairs": [],
         *         "vertices": 2930
         *       },
         *       "source_bytes": 181734,
         *       "vertices": 2930
         *     }
         */
        MeshResource: {
            /**
             * Format: int64
             * @description Bytes of the stored content.
             */
            bytes: number;
            /**
             * Format: int64
             * @description When it was stored.
             */
            created_ms: number;
            /**
             * Format: int64
             * @description Faces, after repairs.
             */
            faces: number;
            /** @description The format it came in. */
            format: string;
            /** @description 32 hexadecimal digits of the BLAKE3 hash of positions and faces: equal content has an equal id. */
            id: string;
            /** @description Where to go from here. */
            links: components["schemas"]["MeshLinks"];
            /** @description The name it was given. */
            name: string | null;
            /**
             * @description Area, bounding box, Euler characteristic, genus, components, boundary loops, each kind of defect with a count
             *     and its first offenders, and what was repaired.
             */
            report: components["schemas"]["MeshReport"];
            /**
             * Format: int64
             * @description Bytes it came in as, after decompression.
             */
            source_bytes: number;
            /**
             * Format: int64
             * @description Vertices, after repairs.
             */
            vertices: number;
        };
        /** @description A state of the modes, as an answer gives it back. */
        ModalState: {
            /** @description The coordinate of each mode. */
            positions: number[];
            /** @description How fast it changes. */
            velocities: number[];
        };
        /**
         * @description Functions that the server knows.
         * @enum {string}
         */
        Named: "coordinates";
        /**
         * @description What the server knows of a surface.
         * @enum {string}
         */
        NamedTarget: "curvature";
        /**
         * @description Weights that the server knows.
         * @enum {string}
         */
        NamedWeights: "anisotropy";
        /** @description A pair as near to a number as another, as far as one can tell. */
        NearPair: {
            /** @description Whether it is delivered. */
            delivered: boolean;
            /** @description Its index among all eigenvalues, from 0. */
            index: number;
            /**
             * Format: double
             * @description Its value.
             */
            value: number;
            /**
             * Format: double
             * @description The exact eigenvalue lies within this of the value.
             */
            within: number;
        };
        /**
         * @description A pair whose enclosure reaches a bound that was asked for: it is for its value that it counts as below the bound or
         *     not.
         */
        OnBound: {
            /** @description Whether it counts as below. */
            below: boolean;
            /**
             * Format: double
             * @description The bound that lies there too.
             */
            bound: number;
            /** @description Its index among all eigenvalues, from 0. */
            index: number;
            /**
             * Format: double
             * @description Its value, in 1/length² of the input.
             */
            value: number;
            /**
             * Format: double
             * @description The exact eigenvalue lies within this of the value.
             */
            within: number;
        };
        /** @description A stored basis. Of the kind `operator_family`. */
        OperatorFamilyBasisResource: components["schemas"]["OperatorFamilyBasisSummary"] & {
            /**
             * @description What is proven: per pair a residual and a bound; the defect of orthonormality; with `method: hsim` whether
             *     nothing was skipped. Of a field basis: of the lowest eigenvalues `estimates` of their errors, `bounds`, and
             *     whether they are as good as is usual, in `accuracy`. Null where nothing is.
             */
            certificate: Record<string, never> | null;
            /**
             * @description What only this kind of basis has. Of a field basis: `field` (its kind), `faces`, `numbers_per_face`,
             *     `dense_columns` (for the harmonic fields of handles), `nonzeros_per_row` and the `area` of the surface. Of maps:
             *     `bases`, `meshes` and `vertices` of the shapes, and how consistent they are, `cycles`. Of any kind, where a
             *     graphics card took part in it or failed to: `dense_solver`, a list of what solved its dense problems, and
             *     `measured_on`, of what measured its errors. Of eigenpairs, where a faster way was given up for a surer one:
             *     `fallbacks`, a list of what and why. Null where there is nothing of this.
             */
            details: components["schemas"]["OperatorFamilyDetails"];
            /** @description m eigenvalues, ascending, in 1/length² of the mesh. */
            eigenvalues: number[];
            /**
             * @description How the operator was made, and why: `laplacian` (`cotangent`, `robust`, `volume` or `graph`) with its `reason`,
             *     what was found of the mesh, how many vertices are no unknowns; of a solid also its `domain`, `solid` or
             *     `surface_of_solid`. Null where the kind has no such choice.
             */
            operator: components["schemas"]["OperatorReport"];
        } & {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "operator_family";
        };
        /** @description A stored basis without its eigenvalues and certificate, as lists have it. Of the kind `operator_family`. */
        OperatorFamilyBasisSummary: components["schemas"]["BasisFacts"] & {
            /**
             * @description The kind of job.
             * @enum {string}
             */
            kind: "operator_family";
            /** @description The mesh it lives on; null where it is of a problem. */
            mesh: string;
            parameters: components["schemas"]["OperatorFamilyParameters"];
        } & {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "operator_family";
        };
        /** @description What only a family of operators has. */
        OperatorFamilyDetails: {
            /** @description The members whose eigenfunctions span the space; none where it holds every function. */
            anchors: components["schemas"]["AnchorReport"][];
            /** @description What solved its dense problems; absent where no graphics card had to do with it. */
            dense_solver?: string[];
        };
        /** @description A job to be done. Of the kind `operator_family`. */
        OperatorFamilyJobRequest: {
            /**
             * @description The kind of job. (enum property replaced by openapi-typescript)
             * @enum {string}
             */
            kind: "operator_family";
            /** @description The id of the mesh. */
            mesh: string;
            /** @description Parameters; what is absent takes its default. */
            parameters?: components["schemas"]["OperatorFamilyParameters"];
            /**
             * Format: int32
             * @description Higher runs first. By default `0`.
             */
            priority?: number;
        };
        /** @description A job. Of the kind `operator_family`. */
        OperatorFamilyJobResource: components["schemas"]["JobFacts"] & {
            /**
             * @description The kind of job.
             * @enum {string}
             */
            kind: "operator_family";
            /** @description The mesh it works on; null where it works on a problem. */
            mesh: string;
            parameters: components["schemas"]["OperatorFamilyParameters"];
        } & {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "operator_family";
        };
        /** @description What is to be computed, every default filled in. */
        OperatorFamilyParameters: {
            /**
             * @description The most functions of the subspace, 10 to 4000. An equal share of them are eigenfunctions of each anchor;
             *     spectra are accurate up to about three quarters of that many pairs. By default `780`.
             * @example 780
             */
            dimension?: number;
            /**
             * Format: int64
             * @description Seeds everything that is drawn at random. By default `0`.
             * @example 0
             */
            seed?: number;
        };
        /** @description Which operator is wanted. */
        OperatorKind: ("auto" | "laplace" | "polygon" | "robust" | "volume" | "graph" | "hodge") | components["schemas"]["OperatorKindExtrinsic"] | components["schemas"]["OperatorKindHamiltonian"] | components["schemas"]["OperatorKindWeighted"];
        /** @description The extrinsic family (thesis, eq. 2.13): `(1 − t) S + t A`, on the Laplacian that `auto` chooses. */
        OperatorKindExtrinsic: {
            extrinsic: components["schemas"]["OperatorKindExtrinsicMembers"];
        };
        /** @description The extrinsic family (thesis, eq. 2.13): `(1 − t) S + t A`, on the Laplacian that `auto` chooses. */
        OperatorKindExtrinsicMembers: {
            /**
             * Format: double
             * @description From 0, the Laplacian, to 1, the operator that also follows the normals.
             * @example 0.5
             */
            t: number;
        };
        /** @description The Hamiltonian: the Laplacian that `auto` chooses, plus a potential. */
        OperatorKindHamiltonian: {
            hamiltonian: components["schemas"]["OperatorKindHamiltonianMembers"];
        };
        /** @description The Hamiltonian: the Laplacian that `auto` chooses, plus a potential. */
        OperatorKindHamiltonianMembers: {
            /** @description The potential. */
            potential: components["schemas"]["Potential"];
        };
        /** @description The Hamiltonian: the Laplacian that `auto` chooses, plus a potential. */
        OperatorKindHamiltonianMembersShown: {
            /** @description The potential. */
            potential: components["schemas"]["PotentialShown"];
        };
        /** @description The Hamiltonian: the Laplacian that `auto` chooses, plus a potential. */
        OperatorKindHamiltonianShown: {
            hamiltonian: components["schemas"]["OperatorKindHamiltonianMembersShown"];
        };
        /** @description Which operator is wanted. */
        OperatorKindShown: ("auto" | "laplace" | "polygon" | "robust" | "volume" | "graph" | "hodge") | components["schemas"]["OperatorKindExtrinsic"] | components["schemas"]["OperatorKindHamiltonianShown"] | components["schemas"]["OperatorKindWeightedShown"];
        /**
         * @description Laplace–Beltrami by cotangents in parts: with weights of the faces, numbers or tensors, and vertices that are
         *     held at zero.
         */
        OperatorKindWeighted: {
            /**
             * @description Laplace–Beltrami by cotangents in parts: with weights of the faces, numbers or tensors, and vertices that are
             *     held at zero.
             */
            weighted: components["schemas"]["OperatorParts"];
        };
        /**
         * @description Laplace–Beltrami by cotangents in parts: with weights of the faces, numbers or tensors, and vertices that are
         *     held at zero.
         */
        OperatorKindWeightedShown: {
            /**
             * @description Laplace–Beltrami by cotangents in parts: with weights of the faces, numbers or tensors, and vertices that are
             *     held at zero.
             */
            weighted: components["schemas"]["OperatorPartsShown"];
        };
        /**
         * @description What a client says of the parts: at most one kind of weights, and vertices that are no unknowns.
         * @example {
         *       "fixed": [
         *         0,
         *         7
         *       ],
         *       "scalars": [
         *         1,
         *         1,
         *         0.25,
         *         4
         *       ]
         *     }
         */
        OperatorParts: {
            /** @description Vertices at which functions are zero (Dirichlet), in any order. By default `[]`. */
            fixed?: number[];
            /**
             * @description A positive number for each face, which multiplies its share of the stiffness. Ones, unless they or tensors are
             *     given. By default `[]`.
             */
            scalars?: number[];
            /**
             * @description Three numbers for each face, one after the other: `xx`, `xy` and `yy` of a positive definite tensor in the frame
             *     of the face, whose `x` runs along the edge from its first corner to its second, and `y` to the side of the
             *     third. By default `[]`.
             */
            tensors?: number[];
        };
        /**
         * @description What a client says of the parts: at most one kind of weights, and vertices that are no unknowns.
         * @example {
         *       "fixed": [
         *         0,
         *         7
         *       ],
         *       "scalars": [
         *         1,
         *         1,
         *         0.25,
         *         4
         *       ]
         *     }
         */
        OperatorPartsShown: {
            fixed?: number[] | components["schemas"]["AbbreviatedList"];
            scalars?: number[] | components["schemas"]["AbbreviatedList"];
            tensors?: number[] | components["schemas"]["AbbreviatedList"];
        };
        /** @description What was chosen and come across when an operator was made. */
        OperatorReport: {
            /**
             * @description Whether the flips came to an end, so that no weight of the stiffness is negative. Without the robust Laplacian
             *     nobody asked.
             */
            delaunay: boolean;
            /** @description Tetrahedra too flat to have a volume: they contribute nothing. */
            flat_tetrahedra?: number;
            /** @description Edges that were flipped on the tufted cover. */
            flips: number;
            /** @description How the Laplacian was made. */
            laplacian: components["schemas"]["Laplacian"];
            /** @description Vertices on which nothing acts; their mass is negligible. */
            massless_vertices: number;
            /**
             * Format: double
             * @description What was added to the length of each edge before anything else, as a share of the mean length; 0 without the
             *     robust Laplacian.
             */
            mollification: number;
            /** @description Edges with three or more faces. */
            non_manifold_edges: number;
            /** @description Vertices whose faces form several fans, though none of their edges has three or more faces. */
            non_manifold_vertices: number;
            /** @description Polygons of more than three corners that the operator is made of. */
            polygons?: number;
            /** @description Why. */
            reason: components["schemas"]["Reason"];
            /** @description Vertices that are no unknowns. */
            removed_vertices: number;
            /** @description Faces with an angle below 0.06 degrees or above 179.94, and those without area. */
            thin_faces: number;
            /** @description Faces without an area: by cotangents they contribute nothing. */
            zero_area_faces: number;
        };
        /** @description A page of a list, newest first. */
        PageOf_BasisSummary: {
            /** @description The items. */
            items: components["schemas"]["BasisSummary"][];
            /** @description Pass this as `from` to get the next page; null on the last. */
            next: string | null;
        };
        /** @description A page of a list, newest first. */
        PageOf_FieldSummary: {
            /** @description The items. */
            items: components["schemas"]["FieldSummary"][];
            /** @description Pass this as `from` to get the next page; null on the last. */
            next: string | null;
        };
        /** @description A page of a list, newest first. */
        PageOf_JobResource: {
            /** @description The items. */
            items: components["schemas"]["JobResource"][];
            /** @description Pass this as `from` to get the next page; null on the last. */
            next: string | null;
        };
        /** @description A page of a list, newest first. */
        PageOf_MeshResource: {
            /** @description The items. */
            items: components["schemas"]["MeshResource"][];
            /** @description Pass this as `from` to get the next page; null on the last. */
            next: string | null;
        };
        /** @description A page of a list, newest first. */
        PageOf_ProblemResource: {
            /** @description The items. */
            items: components["schemas"]["ProblemResource"][];
            /** @description Pass this as `from` to get the next page; null on the last. */
            next: string | null;
        };
        /**
         * @description What a drawing is drawn with.
         * @enum {string}
         */
        Pen: "swelling" | "even";
        /** @description A stored basis. Of the kind `pencil_basis`. */
        PencilBasisBasisResource: components["schemas"]["PencilBasisBasisSummary"] & {
            /**
             * @description What is proven: per pair a residual and a bound; the defect of orthonormality; with `method: hsim` whether
             *     nothing was skipped. Of a field basis: of the lowest eigenvalues `estimates` of their errors, `bounds`, and
             *     whether they are as good as is usual, in `accuracy`. Null where nothing is.
             */
            certificate: components["schemas"]["Certificate"];
            /**
             * @description What only this kind of basis has. Of a field basis: `field` (its kind), `faces`, `numbers_per_face`,
             *     `dense_columns` (for the harmonic fields of handles), `nonzeros_per_row` and the `area` of the surface. Of maps:
             *     `bases`, `meshes` and `vertices` of the shapes, and how consistent they are, `cycles`. Of any kind, where a
             *     graphics card took part in it or failed to: `dense_solver`, a list of what solved its dense problems, and
             *     `measured_on`, of what measured its errors. Of eigenpairs, where a faster way was given up for a surer one:
             *     `fallbacks`, a list of what and why. Null where there is nothing of this.
             */
            details: components["schemas"]["PencilBasisDetails"];
            /** @description m eigenvalues, ascending, in 1/length² of the mesh. */
            eigenvalues: number[];
            /**
             * @description How the operator was made, and why: `laplacian` (`cotangent`, `robust`, `volume` or `graph`) with its `reason`,
             *     what was found of the mesh, how many vertices are no unknowns; of a solid also its `domain`, `solid` or
             *     `surface_of_solid`. Null where the kind has no such choice.
             */
            operator: Record<string, never> | null;
        } & {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "pencil_basis";
        };
        /** @description A stored basis without its eigenvalues and certificate, as lists have it. Of the kind `pencil_basis`. */
        PencilBasisBasisSummary: components["schemas"]["BasisFacts"] & {
            /**
             * @description The kind of job.
             * @enum {string}
             */
            kind: "pencil_basis";
            /** @description The mesh it lives on; null where it is of a problem. */
            mesh: string | null;
            parameters: components["schemas"]["PencilBasisParametersShown"];
            /** @description The problem it is of, of the kind `pencil_basis` alone. */
            pencil: string;
        } & {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "pencil_basis";
        };
        /** @description What only eigenvectors of a problem have. */
        PencilBasisDetails: {
            /** @description What solved its dense problems; absent where no graphics card had to do with it. */
            dense_solver?: string[];
            /** @description Where a faster way was given up for a surer one, and why; absent where none was. */
            fallbacks?: string[];
            /**
             * Format: double
             * @description The multiple c of the mass that residuals ‖Sx − λMx‖ / ‖(S + cM)x‖ are relative to.
             */
            moved: number;
            /**
             * Format: int64
             * @description Rows that are not fixed.
             */
            unknowns: number | null;
        };
        /** @description A job to be done. Of the kind `pencil_basis`. */
        PencilBasisJobRequest: {
            /**
             * @description The kind of job. (enum property replaced by openapi-typescript)
             * @enum {string}
             */
            kind: "pencil_basis";
            /** @description Parameters; what is absent takes its default. */
            parameters?: components["schemas"]["PencilBasisParameters"];
            /** @description Of the kind `pencil_basis`, in the place of a mesh: the id of the problem. */
            pencil: string;
            /**
             * Format: int32
             * @description Higher runs first. By default `0`.
             */
            priority?: number;
        };
        /** @description A job. Of the kind `pencil_basis`. */
        PencilBasisJobResource: components["schemas"]["JobFacts"] & {
            /**
             * @description The kind of job.
             * @enum {string}
             */
            kind: "pencil_basis";
            /** @description The mesh it works on; null where it works on a problem. */
            mesh: string | null;
            parameters: components["schemas"]["PencilBasisParametersShown"];
            /** @description The problem it works on, of the kind `pencil_basis` alone. */
            pencil: string;
        } & {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "pencil_basis";
        };
        /** @description What is to be computed. Every default is filled in. */
        PencilBasisParameters: {
            /**
             * Format: double
             * @description With a count: not the lowest pairs, but those whose eigenvalues are nearest to this number. All below it are
             *     computed as well.
             * @example 1.5
             */
            around?: number | null;
            /**
             * @description With `below`, `between` or `around`: the most pairs that may be computed, 1000 unless it is given.
             * @example 400
             */
            at_most?: number | null;
            /**
             * Format: double
             * @description All pairs below this eigenvalue instead of a count.
             * @example 0.5
             */
            below?: number | null;
            /**
             * @description `[from, to]`: all pairs of an interval, `from` included and `to` not, instead of a count. All below `to` are
             *     computed.
             * @example [
             *       -0.1,
             *       0.1
             *     ]
             */
            between?: number[] | null;
            /**
             * @description How many pairs: the lowest, or with `around` the nearest. 10, unless it is given or bounds take its place.
             * @example 50
             */
            count?: number | null;
            /**
             * @description Rows whose entries are zero in every vector (Dirichlet), from 0, up to a million: they and their columns are
             *     left out. In ascending order, each once, in answers. By default `[]`.
             * @example [
             *       0,
             *       1,
             *       2
             *     ]
             */
            fixed?: number[];
            precision?: components["schemas"]["Precision"] | null;
            /**
             * Format: int64
             * @description Seeds everything that is drawn at random. By default `0`.
             * @example 0
             */
            seed?: number;
            /**
             * Format: double
             * @description The largest residual ‖Sx − λMx‖ / ‖(S + cM)x‖ of a pair, 1e-8 unless it is given; eigenvalues are as exact as
             *     its square.
             * @example 0.000001
             */
            tolerance?: number | null;
        };
        /** @description What is to be computed. Every default is filled in. */
        PencilBasisParametersShown: {
            /**
             * Format: double
             * @description With a count: not the lowest pairs, but those whose eigenvalues are nearest to this number. All below it are
             *     computed as well.
             * @example 1.5
             */
            around?: number | null;
            /**
             * @description With `below`, `between` or `around`: the most pairs that may be computed, 1000 unless it is given.
             * @example 400
             */
            at_most?: number | null;
            /**
             * Format: double
             * @description All pairs below this eigenvalue instead of a count.
             * @example 0.5
             */
            below?: number | null;
            /**
             * @description `[from, to]`: all pairs of an interval, `from` included and `to` not, instead of a count. All below `to` are
             *     computed.
             * @example [
             *       -0.1,
             *       0.1
             *     ]
             */
            between?: number[] | null;
            /**
             * @description How many pairs: the lowest, or with `around` the nearest. 10, unless it is given or bounds take its place.
             * @example 50
             */
            count?: number | null;
            fixed?: number[] | components["schemas"]["AbbreviatedList"];
            precision?: components["schemas"]["Precision"] | null;
            /**
             * Format: int64
             * @description Seeds everything that is drawn at random.
             * @example 0
             */
            seed?: number;
            /**
             * Format: double
             * @description The largest residual ‖Sx − λMx‖ / ‖(S + cM)x‖ of a pair, 1e-8 unless it is given; eigenvalues are as exact as
             *     its square.
             * @example 0.000001
             */
            tolerance?: number | null;
        };
        /** @description Weights of faces. */
        PerFace: components["schemas"]["NamedWeights"] | number[] | components["schemas"]["StoredField"];
        /** @description A hard constraint: a `face` or `point` with a value, as for strokes. */
        Pin: {
            /** @description A direction in ℝ³, projected to the face; its length is the length of the field. */
            direction?: number[] | null;
            /**
             * Format: int32
             * @description The face.
             */
            face?: number | null;
            /** @description A direction in the frame of the face. */
            frame_direction?: number[] | null;
            /** @description A point in the units of the mesh: stands for the face nearest to it. */
            point?: number[] | null;
            /** @description A symmetric tensor in the frame of the face: a₁₁, a₂₂, a₁₂. */
            tensor?: number[] | null;
            /** @description Of a tensor the eigenvalues, along `direction` and across it. */
            values?: number[] | null;
        };
        /** @description The potential of a Hamiltonian. */
        Potential: components["schemas"]["PotentialCurvature"] | components["schemas"]["PotentialValues"];
        /** @description `V = t (κ₁² + κ₂²)` (thesis, appendix 4.C), with the curvatures of the vertices. */
        PotentialCurvature: {
            curvature: components["schemas"]["PotentialCurvatureMembers"];
        };
        /** @description `V = t (κ₁² + κ₂²)` (thesis, appendix 4.C), with the curvatures of the vertices. */
        PotentialCurvatureMembers: {
            /**
             * Format: double
             * @description The weight, without unit, at least 0.
             * @example 0.1
             */
            t: number;
        };
        /** @description The potential of a Hamiltonian. */
        PotentialShown: components["schemas"]["PotentialCurvature"] | components["schemas"]["PotentialValuesShown"];
        /** @description One value for each vertex, in 1/length² of the input. */
        PotentialValues: {
            /** @description One value for each vertex, in 1/length² of the input. */
            values: number[];
        };
        /** @description One value for each vertex, in 1/length² of the input. */
        PotentialValuesShown: {
            values: number[] | components["schemas"]["AbbreviatedList"];
        };
        /**
         * @description The type of the numbers of dense eigenfunctions.
         * @enum {string}
         */
        Precision: "f32" | "f64";
        /**
         * @description An error, in the form of RFC 9457. Some kinds have further members.
         * @example {
         *       "detail": "Face 17 refers to vertex 99 of 40.",
         *       "status": 422,
         *       "title": "The mesh cannot be read",
         *       "type": "/problems/unreadable-mesh/index-out-of-range"
         *     }
         */
        Problem: {
            /** @description A sentence that names the offending element. */
            detail: string;
            /**
             * Format: int32
             * @description The HTTP status.
             */
            status: number;
            /** @description A short summary of the kind. */
            title: string;
            /** @description A stable URI of the kind of problem; it can be opened on this server. */
            type: string;
        };
        /** @description Links of a problem. */
        ProblemLinks: {
            /** @description Its matrices. */
            content: string;
            /** @description The problem itself. */
            self: string;
        };
        /** @description Matrices in parts. */
        ProblemParts: {
            /**
             * Format: binary
             * @description The mass M: a matrix as S, or its diagonal as NPY or a Matrix Market array of one column; the identity where it
             *     is absent.
             */
            mass?: Blob;
            /** @description As in the query. */
            name?: string;
            /**
             * Format: binary
             * @description The matrix S.
             */
            stiffness: Blob;
        };
        /** @description What was found of matrices when they were checked. */
        ProblemReport: {
            /**
             * Format: int64
             * @description Entries of S that are not zero, those on both sides of the diagonal counted.
             */
            entries: number;
            /**
             * Format: int64
             * @description Entries of a factor of S − μM, which tell the memory of a job; null where the matrices were too large to be
             *     analysed at once.
             */
            factor_entries: number | null;
            /**
             * @description What the mass is.
             * @enum {string}
             */
            mass: "identity" | "diagonal" | "sparse";
            /**
             * Format: int64
             * @description Entries of the mass that are stored.
             */
            mass_entries: number;
            /** @description Whether the mass was proven positive definite; where that would have taken much memory, the first job proves it. */
            mass_proven: boolean;
            /**
             * Format: int64
             * @description Rows of both.
             */
            rows: number;
        };
        /**
         * @description A stored problem: sparse symmetric matrices S and M of a pencil `S x = λ M x`.
         * @example {
         *       "bytes": 5123456,
         *       "created_ms": 1795269600000,
         *       "id": "7be0a1d25c9f4e3388d1c6f2904ab57e",
         *       "links": {
         *         "content": "/v1/problems/7be0a1d25c9f4e3388d1c6f2904ab57e/content",
         *         "self": "/v1/problems/7be0a1d25c9f4e3388d1c6f2904ab57e"
         *       },
         *       "name": "bracket, 2 mm",
         *       "report": {
         *         "entries": 412431,
         *         "factor_entries": 18234567,
         *         "mass": "sparse",
         *         "mass_entries": 412431,
         *         "mass_proven": true,
         *         "rows": 29791
         *       },
         *       "rows": 29791,
         *       "source_bytes": 981734
         *     }
         */
        ProblemResource: {
            /**
             * Format: int64
             * @description Bytes of the stored content.
             */
            bytes: number;
            /**
             * Format: int64
             * @description When it was stored.
             */
            created_ms: number;
            /** @description 32 hexadecimal digits of the BLAKE3 hash of the matrices: equal matrices have an equal id. */
            id: string;
            /** @description Where to go from here. */
            links: components["schemas"]["ProblemLinks"];
            /** @description The name it was given. */
            name: string | null;
            /** @description What was found when it was checked. */
            report: components["schemas"]["ProblemReport"];
            /**
             * Format: int64
             * @description Rows of both matrices.
             */
            rows: number;
            /**
             * Format: int64
             * @description Bytes it came in as, after decompression.
             */
            source_bytes: number;
        };
        /**
         * @description The weight of a vertex by its distance from the sample, as a share of the support radius (appendix 2.A). All are 1
         *     at the sample.
         * @enum {string}
         */
        Profile: "cubic" | "linear" | "quintic" | "gaussian";
        /**
         * @description Projected functions.
         * @example {
         *       "coefficients": {
         *         "columns": 1,
         *         "values": [
         *           0.49,
         *           0.01,
         *           -0.02
         *         ]
         *       },
         *       "reconstruction": null,
         *       "relative_errors": [
         *         0.08
         *       ]
         *     }
         */
        ProjectAnswer: {
            /** @description A row for each eigenfunction. */
            coefficients: components["schemas"]["Table"];
            reconstruction: components["schemas"]["Table"] | null;
            /** @description For each function the M-norm of what the basis does not hold, relative to the whole. */
            relative_errors: number[];
        };
        /**
         * @description What to project.
         * @example {
         *       "functions": {
         *         "columns": 1,
         *         "values": [
         *           0.5,
         *           0.25,
         *           0.125
         *         ]
         *       },
         *       "reconstruct": false
         *     }
         */
        ProjectRequest: {
            /** @description `coordinates`, or a table with a row for each vertex. */
            functions: components["schemas"]["Functions"];
            /** @description Onto how many modes, the lowest; all by default. */
            pairs?: number | null;
            /** @description Whether to give the projected functions beside the coefficients. */
            reconstruct?: boolean;
        };
        /** @description What HSIM has proven of modes. */
        ProvenModes: {
            /** @description That none was skipped. */
            complete: boolean;
            /** @description Eigenvalues counted below shifts. */
            inertia: components["schemas"]["InertiaCount"][];
            /**
             * Format: double
             * @description The largest residual of a mode.
             */
            largest_residual: number;
        };
        /** @description A cross field on the surface cut open, and coordinates along it. */
        QuadsAnswer: {
            /** @description For each face the coordinates `u`, `v` of its three corners, six numbers; whole numbers are grid lines. */
            coordinates: components["schemas"]["Table"];
            /**
             * @description By how many degrees the field misses the creases and boundaries that it was to follow: the mean by length, and
             *     the most.
             */
            crease_error: number[] | null;
            /**
             * @description The cut: for each of its edges, its two vertices and the quarter turns by which the directions of the second
             *     face are further than those of the first.
             */
            cut: components["schemas"]["CutEdge"][];
            /**
             * Format: double
             * @description The root of the mean square, by area, of how far the gradients of the coordinates are from the directions, where
             *     1 is the length of those.
             */
            deviation: number;
            /**
             * @description For each face one of its four directions in ℝ³, along which `u` grows; the same one from face to face, but
             *     across the cut.
             */
            directions: components["schemas"]["Table"];
            /**
             * @description Faces that are turned over in the coordinates, and faces around a vertex where none is and the coordinates still
             *     wind as its index does not allow: they lie on each other.
             */
            inverted: number[];
            /**
             * Format: double
             * @description With `integers`, how far the worst of the whole numbers is from one: beyond rounding errors, they contradict
             *     each other.
             */
            misfit: number | null;
            /** @description The singular vertices. */
            singularities: components["schemas"]["SingularVertex"][];
            /**
             * Format: double
             * @description The length between grid lines: half of what was asked for where `integers` can be had only so.
             */
            spacing: number;
            /** @description With `split` the faces that were split, beside which tables have rows for their parts. */
            split: components["schemas"]["SplitFace"][];
        };
        /** @description A seamless parametrisation along a cross field. */
        QuadsRequest: {
            /**
             * Format: double
             * @description From how many degrees between the normals of its faces on an edge is to lie on a grid line, where the field runs
             *     along it; null for none. Boundaries are as `field` says, or are followed. By default `35.0`.
             */
            creases?: number | null;
            /** @description The field. */
            field?: components["schemas"]["CrossSource"];
            /**
             * @description Whether grid lines meet across the cut: singular vertices lie on crossings of them, and translations across the
             *     cut are whole. Without it the parametrisation is seamless alone, which costs one solve.
             */
            integers?: boolean;
            /**
             * Format: double
             * @description The length between grid lines in the units of the mesh; without it, a thirtieth of the root of the area.
             */
            spacing?: number | null;
            /**
             * Format: int32
             * @description How often faces that are turned over are made stiffer, at most; each time costs a factorisation. By default `5`.
             */
            stiffening?: number;
        };
        /** @description The choices of the radial construction; the default is the thesis'. */
        RadialParameters: {
            /** @description How the distance to a sample is measured. By default `"euclidean"`. */
            distance?: components["schemas"]["StepDistance"];
            /** @description How weights fall with the distance. By default `"cubic"`. */
            profile?: components["schemas"]["Profile"];
            /** @description How samples are chosen. By default `"poisson_disk"`. */
            sampling?: components["schemas"]["Sampling"];
            /**
             * Format: double
             * @description How many samples the support of a function holds on average; 7 to 15 in the thesis. By default `10.0`.
             */
            sigma?: number;
        };
        /**
         * @description Whether the server takes work.
         * @example {
         *       "blob_bytes": 73400320,
         *       "content": "s3",
         *       "database": "postgresql",
         *       "free_bytes": null,
         *       "queue_age_seconds": 3,
         *       "status": "ready",
         *       "wal_bytes": 0,
         *       "workers": [
         *         {
         *           "kinds": [],
         *           "memory_bytes": 68719476736,
         *           "processes": 3,
         *           "seats": 12,
         *           "solver_version": "0.1.0+5"
         *         }
         *       ]
         *     }
         */
        Readiness: {
            /**
             * Format: int64
             * @description Bytes of all stored content.
             */
            blob_bytes: number;
            /** @description What keeps the content: `sqlite`, or `s3` or `files` where processes share it. */
            content: string;
            /** @description What keeps the records: `sqlite`, or `postgresql` where processes share them. */
            database: string;
            /**
             * Format: int64
             * @description Free bytes on the disk of the data folder, where the system tells.
             */
            free_bytes: number | null;
            /**
             * Format: int64
             * @description Seconds for which the job has waited that waits for longest and could run; 0 where none waits.
             */
            queue_age_seconds: number;
            /** @description `ready`. */
            status: string;
            /**
             * Format: int64
             * @description Bytes of the write-ahead logs.
             */
            wal_bytes: number;
            /**
             * @description The workers that were heard of within a minute, by what they have; empty where this process shares its jobs with
             *     none.
             */
            workers: components["schemas"]["WorkerClass"][];
        };
        /**
         * @description Why the Laplacian is made so.
         * @enum {string}
         */
        Reason: "requested" | "fair_mesh" | "polygons" | "non_manifold" | "thin_faces" | "points" | "needle";
        /** @description What was judged. */
        ReceiptHashes: {
            /** @description BLAKE3 of the content of the basis, 64 hexadecimal digits. */
            basis: string;
            /** @description The id of the mesh; absent where there is a problem. */
            mesh?: string;
            /** @description The id of the problem, of a basis of the kind `pencil_basis`. */
            problem?: string;
        };
        /** @description A count made anew. */
        Recount: {
            /**
             * Format: int64
             * @description Eigenvalues below it.
             */
            below: number;
            /**
             * Format: int64
             * @description How many the certificate says there are; null where it did not count there.
             */
            claimed: number | null;
            /**
             * Format: double
             * @description The shift, in 1/length² of the mesh.
             */
            shift: number;
            /**
             * Format: int64
             * @description How many eigenvalues of the basis lie below, with those before its first.
             */
            values_below: number;
        };
        /** @description How approximate eigenfunctions are filtered. In JSON: `"inverse_iteration"` or `{"chebyshev": {"degree": 12}}`. */
        Refinement: "inverse_iteration" | components["schemas"]["RefinementChebyshev"];
        /** @description A Chebyshev polynomial of `M⁻¹K`: products with sparse matrices alone. Needs a lumped mass. */
        RefinementChebyshev: {
            chebyshev: components["schemas"]["RefinementChebyshevMembers"];
        };
        /** @description A Chebyshev polynomial of `M⁻¹K`: products with sparse matrices alone. Needs a lumped mass. */
        RefinementChebyshevMembers: {
            /**
             * @description The degree, from 1 to 200.
             * @example 20
             */
            degree: number;
        };
        /**
         * @description A new name.
         * @example {
         *       "name": "bunny, scanned in March"
         *     }
         */
        RenameRequest: {
            /** @description A name for people, at most 200 characters; null or nothing but blanks takes it away. */
            name?: string | null;
        };
        /** @description One kind of repair and how many elements it touched. */
        Repair: {
            /** @description To how many elements. */
            count: number;
            /** @description What was done. */
            kind: components["schemas"]["RepairKind"];
        };
        /**
         * @description The kinds of repair, in the order in which they are done.
         * @enum {string}
         */
        RepairKind: "triangulated_polygons" | "dropped_short_faces" | "merged_vertices" | "dropped_repeated_vertex_faces" | "dropped_duplicate_faces" | "flipped_faces" | "dropped_unreferenced_vertices" | "left_out_tetrahedra";
        /**
         * @description A mesh that can be generated.
         * @example {
         *       "description": "A bell, open at its rim",
         *       "fewest_vertices": 7,
         *       "name": "bell"
         *     }
         */
        Sample: {
            /** @description What it is, in a few words. */
            description: string;
            /** @description The fewest vertices that it can be made of. */
            fewest_vertices: number;
            /** @description Its name in paths. */
            name: string;
        };
        /**
         * @description The meshes that can be generated.
         * @example {
         *       "items": [
         *         {
         *           "description": "A bell, open at its rim",
         *           "fewest_vertices": 7,
         *           "name": "bell"
         *         }
         *       ]
         *     }
         */
        Samples: {
            /** @description All of them but further genera. */
            items: components["schemas"]["Sample"][];
        };
        /**
         * @description Where the functions of a subspace are centred.
         * @enum {string}
         */
        Sampling: "poisson_disk" | "farthest_points" | "well_spread";
        /** @description What a saved design was asked for with, and its energies. */
        SavedDesign: {
            /**
             * Format: double
             * @description The squared deviation from what the field is aligned to, on the surface of unit area.
             */
            alignment_energy: number | null;
            /**
             * Format: double
             * @description The biharmonic energy, on the surface of unit area.
             */
            biharmonic_energy: number;
            /**
             * Format: double
             * @description With `refine`, how far the field of the basis is from it, as a share of its length.
             */
            error: number | null;
            /** @description What is stored in a face. */
            field: components["schemas"]["FieldKind"];
            /**
             * Format: double
             * @description The harmonic energy of the field, on the surface of unit area.
             */
            harmonic_energy: number;
            /**
             * @description With `exact` singularities the pairs of neighbouring faces across which the field turns by more than half a
             *     turn, in the numbering of the request that asks; quads keep its singular vertices by them. Absent from others.
             */
            matching?: components["schemas"]["MatchedFaces"][] | null;
            /**
             * @description How the request numbers vertices and faces.
             * @enum {string}
             */
            numbering: "file" | "kept";
            /** @description The request, as it can be sent again. */
            request: components["schemas"]["DesignRequest"];
        };
        /**
         * @description A design that is to be saved.
         * @example {
         *       "design": {
         *         "strokes": [
         *           {
         *             "direction": [
         *               0,
         *               0,
         *               1
         *             ],
         *             "face": 17
         *           }
         *         ]
         *       },
         *       "name": "combed back"
         *     }
         */
        SaveDesignRequest: {
            /**
             * @description What is asked for, as of `POST /v1/bases/{id}/design`, but for `faces` and `error`. Up to 256 KiB; tables are
             *     better uploaded and named by their ids.
             */
            design: components["schemas"]["DesignRequest"];
            /** @description A name for people, at most 200 characters. */
            name?: string | null;
        };
        /**
         * @description What makes spectra of shapes of any size comparable.
         * @enum {string}
         */
        ScaleName: "area" | "first" | "none";
        /** @description A signature of points. */
        SignatureKind: components["schemas"]["SignatureKindHeatKernel"] | components["schemas"]["SignatureKindWaveKernel"] | components["schemas"]["SignatureKindGlobalPoint"];
        /** @description The global point signature, `φ_k(x)/√λ_k`. */
        SignatureKindGlobalPoint: {
            /** @description How many modes; 20 by default. */
            count?: number | null;
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "global_point";
        };
        /** @description The heat kernel signature, `Σ e^{−λt} φ(x)²` for each time. */
        SignatureKindHeatKernel: {
            /** @description Without times, how many, log-spaced in `[4 ln 10 / λ_max, 4 ln 10 / λ_1]`; 16 by default. */
            count?: number | null;
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "heat_kernel";
            /** @description Whether to divide by the trace `Σ e^{−λt}`. */
            normalised?: boolean;
            /** @description Times above zero, in length² of the mesh. */
            times?: number[] | null;
        };
        /** @description The wave kernel signature. */
        SignatureKindWaveKernel: {
            /** @description How many energies, at least 32; 100 by default. */
            count?: number | null;
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "wave_kernel";
        };
        /**
         * @description Which signature, and where.
         * @example {
         *       "signature": {
         *         "count": 16,
         *         "kind": "heat_kernel"
         *       },
         *       "vertices": [
         *         17,
         *         2930
         *       ]
         *     }
         */
        SignatureRequest: {
            /** @description The signature. */
            signature: components["schemas"]["SignatureKind"];
            /** @description Vertices; without them, all. */
            vertices?: number[] | null;
        };
        /**
         * @description Similar points, the most similar first.
         * @example {
         *       "differences": [
         *         0,
         *         0.0013
         *       ],
         *       "vertices": [
         *         17,
         *         2930
         *       ]
         *     }
         */
        SimilarAnswer: {
            /** @description How different their signatures are from that of the point. */
            differences: number[];
            /** @description Their numbers; the first is the point itself, or one that cannot be told from it. */
            vertices: number[];
        };
        /**
         * @description A point, and what makes others similar to it.
         * @example {
         *       "count": 20,
         *       "signature": {
         *         "count": 100,
         *         "kind": "wave_kernel"
         *       },
         *       "vertex": 17
         *     }
         */
        SimilarRequest: {
            /** @description How many points. By default `10`. */
            count?: number;
            /** @description By what they are compared. */
            signature: components["schemas"]["SignatureKind"];
            /**
             * Format: int32
             * @description The point.
             */
            vertex?: number;
        };
        /**
         * @description A motion at some times.
         * @example {
         *       "displacements": [
         *         [
         *           0,
         *           0,
         *           0
         *         ],
         *         [
         *           0,
         *           0,
         *           -0.001
         *         ]
         *       ],
         *       "energies": [
         *         0.5,
         *         0.49
         *       ],
         *       "held_loads": [],
         *       "left_out": 0,
         *       "positions": null,
         *       "state": {
         *         "positions": [
         *           0.1
         *         ],
         *         "velocities": [
         *           -2
         *         ]
         *       },
         *       "times": [
         *         0,
         *         0.001
         *       ],
         *       "velocities": null
         *     }
         */
        SimulateAnswer: {
            /** @description At each time three numbers for each vertex. */
            displacements: number[][] | null;
            /** @description Kinetic plus elastic energy at each. */
            energies: number[];
            /** @description Impulses and forces that do nothing, as their vertex is held: their places among the loads, from 0. */
            held_loads: number[];
            /**
             * Format: double
             * @description Which share of initial displacements and velocities, the larger of the two, no mode holds. What held vertices
             *     are given is left out, and counts by its mass.
             */
            left_out: number;
            /** @description At each time the coordinates of the modes. */
            positions: number[][] | null;
            state: components["schemas"]["ModalState"] | null;
            /** @description The times. */
            times: number[];
            /** @description At each time the velocities of these. */
            velocities: number[][] | null;
        };
        /**
         * @description What happens to an object, and what is to be told of it.
         * @example {
         *       "damping": {
         *         "alpha": 2,
         *         "beta": 1e-7
         *       },
         *       "loads": [
         *         {
         *           "impulse": {
         *             "momentum": [
         *               0,
         *               0,
         *               -0.01
         *             ],
         *             "time": 0,
         *             "vertex": 17
         *           }
         *         }
         *       ],
         *       "times": [
         *         0,
         *         0.001,
         *         0.002
         *       ]
         *     }
         */
        SimulateRequest: {
            /** @description Damping; none, unless it is given. */
            damping?: components["schemas"]["DampingRequest"];
            /**
             * @description What is wanted at each time.
             * @enum {string}
             */
            give?: "displacements" | "state";
            initial?: components["schemas"]["InitialRequest"] | null;
            /** @description Impulses, forces and accelerations; those on clamped vertices do nothing, and the answer names them. */
            loads?: components["schemas"]["LoadRequest"][];
            sound?: components["schemas"]["SoundRequest"] | null;
            /** @description Times, ascending. */
            times?: number[];
            /** @description Vertices whose displacements are wanted; all, unless it is given. */
            vertices?: number[] | null;
        };
        /**
         * @description Prescribed singularities: the smoothest field of unit length that has these and no others is what the design stays
         *     close to.
         */
        SingularitiesRequest: {
            /** @description The singular vertices; on a component without boundary their indices add up to its Euler characteristic. */
            at: components["schemas"]["SingularVertex"][];
            /**
             * @description Whether the field itself is wanted: of length 1 everywhere, not of the space, with exactly these singularities,
             *     on each component turned to fit the strokes there, or where there are none the alignment. Coefficients and
             *     energies are those of the design that stays close to it.
             */
            exact?: boolean;
            /**
             * Format: double
             * @description The weight of the squared deviation from that field. By default a hundred times what that field resists with in
             *     the space, its energy for each square of its length: it is then missed by about a percent, as a stroke of
             *     strength 1 is, in spaces of all dimensions.
             */
            weight?: number | null;
        };
        /** @description A vertex at which a field is singular. */
        SingularVertex: {
            /**
             * Format: double
             * @description The index: a multiple of 1/n for n-fields, of 1/2 for tensor fields.
             */
            index: number;
            /**
             * Format: int32
             * @description The vertex.
             */
            vertex: number;
        };
        /** @description What is known about the tetrahedra of a solid after they were checked. */
        SolidReport: {
            /** @description Tetrahedra that repeat a vertex, or equal an earlier one; they were dropped. */
            dropped: number;
            /** @description Tetrahedra too flat to have a volume; they are kept, since dropping them would open a hole, and resist nothing. */
            flat: number;
            /** @description Triangles of the file; the surface is that of the tetrahedra instead. Where the two differ, defects say by what. */
            given_triangles: number;
            /** @description Tetrahedra that were given inside out, and turned. */
            inverted: number;
            /** @description Triangles that more than two tetrahedra share. */
            overfull_triangles: number;
            /** @description Tetrahedra. */
            tetrahedra: number;
            /** @description Vertices, those of the surface first. */
            vertices: number;
            /**
             * Format: double
             * @description Volume, in cubed units of the input.
             */
            volume: number;
        };
        /** @description What is to be heard. */
        SoundRequest: {
            /** @description Where the ear is, in units of the mesh. */
            listener: number[];
            /**
             * Format: int32
             * @description Samples a second, 8000 to 192000. By default `44100`.
             */
            sample_rate?: number;
            /**
             * Format: double
             * @description How long, at most 60. By default `1.0`.
             */
            seconds?: number;
        };
        /**
         * @description The lowest pairs of an operator of the family.
         * @example {
         *       "coefficients": null,
         *       "covered": 3,
         *       "eigenvalues": [
         *         0,
         *         1.9,
         *         2.1
         *       ],
         *       "modes": null
         *     }
         */
        SpectrumAnswer: {
            coefficients: components["schemas"]["Table"] | null;
            /**
             * @description How many of them, from the lowest, the space of the family was made for; those beyond can be many times too
             *     large. None where `curvature` is above 20, all where the space has every function of the mesh.
             */
            covered: number;
            /** @description Ascending, in 1/length² of the mesh. */
            eigenvalues: number[];
            modes: components["schemas"]["Table"] | null;
        };
        /**
         * @description An operator of the family.
         * @example {
         *       "count": 100,
         *       "curvature": 0,
         *       "extrinsic": 0.5,
         *       "give": "eigenvalues"
         *     }
         */
        SpectrumRequest: {
            /** @description Pairs, at most the dimension of the family; without it 100, or as many as that dimension where it is less. */
            count?: number | null;
            /**
             * Format: double
             * @description `v`, 0 to 1e6, in `+ v V`, where the potential is `κ₁² + κ₂²`.
             */
            curvature?: number;
            /**
             * Format: double
             * @description `t`, 0 to 1, in `(1 − t) S + t A`.
             */
            extrinsic?: number;
            /**
             * @description What is wanted of them.
             * @enum {string}
             */
            give?: "eigenvalues" | "coefficients" | "modes";
            /**
             * @description With `modes` or `coefficients`: this pair alone, counted from 0, in one column. What shows one function needs no
             *     others.
             */
            mode?: number | null;
        };
        /** @description A face that was split at its barycentre. */
        SplitFace: {
            /**
             * Format: int32
             * @description The face: from now on its part on the edge between its corners 0 and 1.
             */
            face: number;
            /** @description The parts on the edges between corners 1 and 2, and 2 and 0. */
            parts: number[];
            /**
             * Format: int32
             * @description The new vertex, the last corner of each part.
             */
            vertex: number;
        };
        /** @description Seconds spent in a stage. */
        StageSeconds: {
            /**
             * Format: double
             * @description Wall-clock seconds.
             */
            seconds: number;
            /** @description The name of the stage. */
            stage: string;
        };
        /**
         * @description Where plain subspace iteration starts.
         * @enum {string}
         */
        Start: "random" | "bathe";
        /**
         * @description Where a job stands.
         * @enum {string}
         */
        Status: "enqueued" | "processing" | "succeeded" | "failed" | "canceled";
        /** @description How the distance from a source to the vertices around it is measured. */
        StepDistance: ("dijkstra" | "euclidean" | "fast_marching") | components["schemas"]["StepDistanceStvd"];
        /**
         * @description Short-term vector Dijkstra (Campen et al. 2013): the last `window` edges of a path are unfolded into the plane
         *     and replaced by the straight line between their ends. A window of 1 is Dijkstra.
         */
        StepDistanceStvd: {
            stvd: components["schemas"]["StepDistanceStvdMembers"];
        };
        /**
         * @description Short-term vector Dijkstra (Campen et al. 2013): the last `window` edges of a path are unfolded into the plane
         *     and replaced by the straight line between their ends. A window of 1 is Dijkstra.
         */
        StepDistanceStvdMembers: {
            /**
             * Format: int32
             * @description How many edges are unfolded at most; 3 and 6 in the thesis. At most `STVD_WINDOW_MAX` are used.
             * @example 6
             */
            window: number;
        };
        /**
         * @description How eigenfunctions are stored.
         * @enum {string}
         */
        StorageKind: "dense" | "compact";
        /** @description A stored field by its id. */
        StoredField: {
            /**
             * @description The id: that of an upload (`POST /v1/meshes/{id}/fields`) or of a saved design (`POST /v1/bases/{id}/designs`)
             *     on the same mesh.
             * @example 5c1f7e0a93b84d6f8e21a7b0c4d95f36
             */
            stored: string;
        };
        /**
         * @description A soft constraint: one `face` or `point` with a value, or `points`, a line whose own direction the field is to
         *     follow. A value is a `direction` in ℝ³ or a `frame_direction`; for tensors a `direction` with `values`, or a
         *     `tensor`.
         */
        Stroke: {
            /** @description A direction in ℝ³, projected to the face; its length is the length of the field. */
            direction?: number[] | null;
            /**
             * Format: int32
             * @description The face.
             */
            face?: number | null;
            /** @description A direction in the frame of the face. */
            frame_direction?: number[] | null;
            /** @description A point in the units of the mesh: stands for the face nearest to it. */
            point?: number[] | null;
            /** @description A line of points: the faces nearest to them, each with the direction in which the line goes on, of length 1. */
            points?: number[][] | null;
            /**
             * Format: double
             * @description How firmly the stroke holds, against what the field resists with there: alone, a stroke of strength `s` on one
             *     face misses the share `1 / (1 + 100 s)` of its length. 1 is met to a percent, 0.1 to a tenth, on every surface,
             *     at every scale and with all weights of the energies. By default `1.0`.
             */
            strength?: number | null;
            /** @description A symmetric tensor in the frame of the face: a₁₁, a₂₂, a₁₂. */
            tensor?: number[] | null;
            /** @description Of a tensor the eigenvalues, along `direction` and across it. */
            values?: number[] | null;
        };
        /**
         * @description Which surface a mesh with tetrahedra stands for.
         * @enum {string}
         */
        SurfaceOf: "boundary" | "given";
        /** @description A table of numbers. */
        Table: {
            /** @description Functions side by side. */
            columns?: number;
            /** @description Values, row after row; null, or not a number, at vertices and faces of a file that have none. */
            values: number[];
        };
        /** @description What to align to. */
        Target: components["schemas"]["NamedTarget"] | components["schemas"]["FieldTable"];
        /** @description How light becomes lines. */
        ToneRequest: {
            /**
             * Format: double
             * @description The darkness, from 0 to 1, from which on lines are crossed by those of another direction, of 2-fields and
             *     vectors by lines across them; 1 and more: never. By default `0.55`.
             */
            cross?: number | null;
            /**
             * Format: double
             * @description The brightness, up to 1, from which on the paper stays white. By default `0.8`.
             */
            highlight?: number | null;
            /** @description Towards the light: above the left shoulder of who looks where it is left out. */
            light?: number[] | null;
            /** @description Whether the surface throws shadows on itself. By default `true`. */
            shadows?: boolean | null;
        };
        /** @description By what each part of a function is multiplied, as a function of the eigenvalue `λ ≥ 0` in 1/length² of the input. */
        Transfer: components["schemas"]["TransferLowPass"] | components["schemas"]["TransferHighPass"] | components["schemas"]["TransferBandPass"] | components["schemas"]["TransferGain"] | components["schemas"]["TransferHeat"] | components["schemas"]["TransferSharpen"] | components["schemas"]["TransferCurve"] | components["schemas"]["TransferSamples"];
        /** @description Keeps `low ≤ λ ≤ high` alone. */
        TransferBandPass: {
            /**
             * Format: double
             * @description The largest eigenvalue kept.
             */
            high: number;
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "band_pass";
            /**
             * Format: double
             * @description The least eigenvalue kept.
             */
            low: number;
        };
        /**
         * @description Any function of the eigenvalue, by its values at some of them: linear in between, constant outside. The detail
         *     beyond the basis gets what the last eigenvalue gets.
         */
        TransferCurve: {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "curve";
            /** @description Pairs of an eigenvalue and a factor, eigenvalues strictly ascending. */
            points: number[][];
        };
        /** @description Multiplies `low ≤ λ ≤ high` by `gain` and keeps everything else: exaggerates or softens features of one size. */
        TransferGain: {
            /**
             * Format: double
             * @description The factor.
             */
            gain: number;
            /**
             * Format: double
             * @description The largest eigenvalue that is changed.
             */
            high: number;
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "gain";
            /**
             * Format: double
             * @description The least eigenvalue that is changed.
             */
            low: number;
        };
        /**
         * @description Diffusion: `e^{−λ t}`, which grows where an eigenvalue is negative; the detail beyond the basis is damped as its
         *     last mode is.
         */
        TransferHeat: {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "heat";
            /**
             * Format: double
             * @description The time `t ≥ 0`, in length² of the input.
             */
            time: number;
        };
        /** @description Keeps `λ > cutoff` and the detail beyond the basis. */
        TransferHighPass: {
            /**
             * Format: double
             * @description The largest eigenvalue removed.
             */
            cutoff: number;
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "high_pass";
        };
        /** @description Keeps `λ ≤ cutoff`; the detail beyond the basis goes too. */
        TransferLowPass: {
            /**
             * Format: double
             * @description The largest eigenvalue kept.
             */
            cutoff: number;
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "low_pass";
        };
        /** @description One factor for each eigenvalue, and one for the detail beyond the basis. */
        TransferSamples: {
            /**
             * Format: double
             * @description The factor of what the basis does not hold.
             */
            beyond: number;
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "samples";
            /** @description `m` factors. */
            values: number[];
        };
        /**
         * @description Sharpening: `1 + strength · λ / (λ + cutoff)`, from 1 for the coarsest shape to `1 + strength` for detail, that
         *     beyond the basis included. A negative strength, not below −1, softens. Eigenvalues below zero are taken as 0.
         */
        TransferSharpen: {
            /**
             * Format: double
             * @description The eigenvalue where half of the strength is reached.
             */
            cutoff: number;
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "sharpen";
            /**
             * Format: double
             * @description By how much detail grows.
             */
            strength: number;
        };
        /** @description Vectors to be carried. */
        TransportRequest: {
            /**
             * @description The vectors: each with a `face` or a `point`, and a `direction` or a `frame_direction` whose length is carried
             *     as well.
             */
            sources: components["schemas"]["Pin"][];
        };
        /**
         * @description Which function of the eigenvalues.
         * @example {
         *       "weights": [
         *         0,
         *         1,
         *         0.5
         *       ]
         *     }
         */
        ValueGradientRequest: {
            /**
             * @description What each eigenvalue counts, from the first on: the derivatives of a loss by the eigenvalues. Those beyond the
             *     last do not count.
             */
            weights?: number[];
        };
        /**
         * @description What was judged and what was found, as the answer has it.
         * @example {
         *       "boundary": "neumann",
         *       "bounds": [
         *         1e-14,
         *         1e-9,
         *         1e-9
         *       ],
         *       "counts": [
         *         {
         *           "below": 3,
         *           "claimed": 3,
         *           "shift": 2.4,
         *           "values_below": 3
         *         }
         *       ],
         *       "distances": [
         *         1e-14,
         *         0.000002,
         *         0.000003
         *       ],
         *       "eigenvalues": [
         *         0,
         *         1.1,
         *         1.9
         *       ],
         *       "findings": [],
         *       "first": 0,
         *       "hash": "BLAKE3 of the content of the basis, the id of the mesh",
         *       "hashes": {
         *         "basis": "2f1c…",
         *         "mesh": "0f6d2c4ab1e84cf29be2e3f0b5d1a7c3"
         *       },
         *       "mass": "barycentric",
         *       "operator": "laplace",
         *       "orthonormality_defect": 2e-15,
         *       "pairs": 3,
         *       "proven_complete": 3,
         *       "residuals": [
         *         1e-16,
         *         2e-7,
         *         3e-7
         *       ],
         *       "seconds": 0.04,
         *       "solved_with": {
         *         "count": 3,
         *         "method": "hsim"
         *       },
         *       "verdict": "confirmed",
         *       "verified_by": "chladni 0.1.0"
         *     }
         */
        VerificationReceipt: {
            /**
             * @description Its boundary condition; of vibration modes `free` or `clamped`, of a problem `dirichlet` where rows are fixed,
             *     else `none`.
             */
            boundary: string;
            /** @description Their bounds. */
            bounds: number[];
            /** @description Eigenvalues counted anew below shifts. */
            counts: components["schemas"]["Recount"][];
            /** @description Some exact eigenvalue lies within this of each. */
            distances: number[];
            /** @description The eigenvalues of the basis. */
            eigenvalues: number[];
            /** @description What is wrong, a sentence each. */
            findings: string[];
            /**
             * Format: int64
             * @description The index of the first pair among all eigenvalues.
             */
            first: number;
            /** @description What the hashes are of. */
            hash: string;
            /** @description BLAKE3 of the content of the basis, and the id of the mesh or of the problem. */
            hashes: components["schemas"]["ReceiptHashes"];
            /** @description Its mass matrix; `lumped` of vibration modes, of a problem `identity`, `diagonal` or `sparse`. */
            mass: string;
            /**
             * @description The operator that was assembled anew; `{"elastic": …}` of vibration modes, `pencil` where the matrices came as
             *     they are.
             */
            operator: unknown;
            /**
             * Format: double
             * @description The largest entry of |ΦᵀMΦ − I|.
             */
            orthonormality_defect: number;
            /**
             * Format: int64
             * @description How many pairs there are.
             */
            pairs: number;
            /**
             * Format: int64
             * @description So many of the pairs, from the first, are proven to be all there are from there; null where the basis claims no
             *     such thing, or it is not confirmed.
             */
            proven_complete: number | null;
            /** @description The residuals of the functions as they are stored. */
            residuals: number[];
            /**
             * Format: double
             * @description How long it took.
             */
            seconds: number;
            /** @description The parameters of the job that made the basis. */
            solved_with: unknown;
            /**
             * @description `confirmed` where everything is as the basis says, `refuted` where something is not, `unconfirmed` where nothing
             *     is wrong and something could not be judged.
             */
            verdict: string;
            /** @description Program and version. */
            verified_by: string;
        };
        /** @description A stored basis. Of the kind `vibration_basis`. */
        VibrationBasisBasisResource: components["schemas"]["VibrationBasisBasisSummary"] & {
            /**
             * @description What is proven: per pair a residual and a bound; the defect of orthonormality; with `method: hsim` whether
             *     nothing was skipped. Of a field basis: of the lowest eigenvalues `estimates` of their errors, `bounds`, and
             *     whether they are as good as is usual, in `accuracy`. Null where nothing is.
             */
            certificate: components["schemas"]["VibrationCertificate"] | null;
            /**
             * @description What only this kind of basis has. Of a field basis: `field` (its kind), `faces`, `numbers_per_face`,
             *     `dense_columns` (for the harmonic fields of handles), `nonzeros_per_row` and the `area` of the surface. Of maps:
             *     `bases`, `meshes` and `vertices` of the shapes, and how consistent they are, `cycles`. Of any kind, where a
             *     graphics card took part in it or failed to: `dense_solver`, a list of what solved its dense problems, and
             *     `measured_on`, of what measured its errors. Of eigenpairs, where a faster way was given up for a surer one:
             *     `fallbacks`, a list of what and why. Null where there is nothing of this.
             */
            details: components["schemas"]["VibrationBasisDetails"];
            /** @description m eigenvalues, ascending, in 1/length² of the mesh. */
            eigenvalues: number[];
            /**
             * @description How the operator was made, and why: `laplacian` (`cotangent`, `robust`, `volume` or `graph`) with its `reason`,
             *     what was found of the mesh, how many vertices are no unknowns; of a solid also its `domain`, `solid` or
             *     `surface_of_solid`. Null where the kind has no such choice.
             */
            operator: components["schemas"]["ElasticReport"];
        } & {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "vibration_basis";
        };
        /** @description A stored basis without its eigenvalues and certificate, as lists have it. Of the kind `vibration_basis`. */
        VibrationBasisBasisSummary: components["schemas"]["BasisFacts"] & {
            /**
             * @description The kind of job.
             * @enum {string}
             */
            kind: "vibration_basis";
            /** @description The mesh it lives on; null where it is of a problem. */
            mesh: string;
            parameters: components["schemas"]["VibrationBasisParametersShown"];
        } & {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "vibration_basis";
        };
        /** @description What only a vibration basis has. */
        VibrationBasisDetails: {
            /** @description What solved its dense problems; absent where no graphics card had to do with it. */
            dense_solver?: string[];
            /** @description The frequency of each mode, in 1/time. */
            frequencies: number[];
            /**
             * Format: int64
             * @description The first modes, of frequency zero, that move the object as a rigid one.
             */
            rigid_motions: number;
            /**
             * Format: int64
             * @description Vertices of the object.
             */
            vertices: number;
        };
        /** @description A job to be done. Of the kind `vibration_basis`. */
        VibrationBasisJobRequest: {
            /**
             * @description The kind of job. (enum property replaced by openapi-typescript)
             * @enum {string}
             */
            kind: "vibration_basis";
            /** @description The id of the mesh. */
            mesh: string;
            /** @description Parameters; what is absent takes its default. */
            parameters?: components["schemas"]["VibrationBasisParameters"];
            /**
             * Format: int32
             * @description Higher runs first. By default `0`.
             */
            priority?: number;
        };
        /** @description A job. Of the kind `vibration_basis`. */
        VibrationBasisJobResource: components["schemas"]["JobFacts"] & {
            /**
             * @description The kind of job.
             * @enum {string}
             */
            kind: "vibration_basis";
            /** @description The mesh it works on; null where it works on a problem. */
            mesh: string;
            parameters: components["schemas"]["VibrationBasisParametersShown"];
        } & {
            /**
             * @description discriminator enum property added by openapi-typescript
             * @enum {string}
             */
            kind: "vibration_basis";
        };
        /** @description What is to be computed, checked, every default filled in. */
        VibrationBasisParameters: components["schemas"]["VibrationByHsim"] | components["schemas"]["VibrationByApproximation"];
        /** @description What is to be computed, checked, every default filled in. */
        VibrationBasisParametersShown: components["schemas"]["VibrationByHsimShown"] | components["schemas"]["VibrationByApproximationShown"];
        /** @description The fast approximation: modes of a space of local functions, refined on the mesh. */
        VibrationByApproximation: {
            /**
             * @description Vertices that are held fast.
             * @example [
             *       0,
             *       1,
             *       2
             *     ]
             */
            clamped?: number[];
            /**
             * @description Whether a shell is held from turning about edges whose two ends are held: a clamp. Else it turns there without a
             *     moment: a hinge. By default `false`.
             * @example true
             */
            clamped_rotations?: boolean;
            /**
             * @description Modes, rigid motions included. By default `100`.
             * @example 60
             */
            count?: number;
            /**
             * @description Scalar functions of the subspace of `approximate`; twice the count, unless it is given.
             * @example 120
             */
            dimension?: number | null;
            /**
             * @description Inverse iterations on the mesh that refine the modes of `approximate`, 0 to 4; with any they are kept as
             *     columns. Without it as many as bring the estimated error of every frequency to 1 %.
             * @example 2
             */
            inverse_iterations?: number | null;
            /**
             * @description Whether the functions of `approximate` come with coordinates of their patches, so that patches can turn.
             * @example true
             */
            local_coordinates?: boolean | null;
            /** @description What the object is made of. */
            material?: components["schemas"]["Material"];
            /**
             * @description How it is computed.
             * @enum {string}
             */
            method: "approximate";
            /**
             * Format: int64
             * @description Seeds everything that is drawn at random.
             * @example 0
             */
            seed?: number;
            /**
             * Format: double
             * @description The thickness of a shell, in units of the mesh; without it the tetrahedra of a solid vibrate.
             * @example 0.001
             */
            thickness?: number | null;
        };
        /** @description The fast approximation: modes of a space of local functions, refined on the mesh. */
        VibrationByApproximationShown: {
            clamped?: number[] | components["schemas"]["AbbreviatedList"];
            /**
             * @description Whether a shell is held from turning about edges whose two ends are held: a clamp. Else it turns there without a
             *     moment: a hinge.
             * @example true
             */
            clamped_rotations?: boolean;
            /**
             * @description Modes, rigid motions included.
             * @example 60
             */
            count?: number;
            /**
             * @description Scalar functions of the subspace of `approximate`; twice the count, unless it is given.
             * @example 120
             */
            dimension?: number | null;
            /**
             * @description Inverse iterations on the mesh that refine the modes of `approximate`, 0 to 4; with any they are kept as
             *     columns. Without it as many as bring the estimated error of every frequency to 1 %.
             * @example 2
             */
            inverse_iterations?: number | null;
            /**
             * @description Whether the functions of `approximate` come with coordinates of their patches, so that patches can turn.
             * @example true
             */
            local_coordinates?: boolean | null;
            /** @description What the object is made of. */
            material?: components["schemas"]["Material"];
            /**
             * @description How it is computed.
             * @enum {string}
             */
            method: "approximate";
            /**
             * Format: int64
             * @description Seeds everything that is drawn at random.
             * @example 0
             */
            seed?: number;
            /**
             * Format: double
             * @description The thickness of a shell, in units of the mesh; without it the tetrahedra of a solid vibrate.
             * @example 0.001
             */
            thickness?: number | null;
        };
        /** @description HSIM: modes to a tolerance, proven complete, dense. */
        VibrationByHsim: {
            /**
             * @description Vertices that are held fast.
             * @example [
             *       0,
             *       1,
             *       2
             *     ]
             */
            clamped?: number[];
            /**
             * @description Whether a shell is held from turning about edges whose two ends are held: a clamp. Else it turns there without a
             *     moment: a hinge. By default `false`.
             * @example true
             */
            clamped_rotations?: boolean;
            /**
             * @description Modes, rigid motions included. By default `100`.
             * @example 60
             */
            count?: number;
            /** @description What the object is made of. */
            material?: components["schemas"]["Material"];
            /**
             * @description How it is computed. By default `"hsim"`.
             * @enum {string}
             */
            method?: "hsim";
            /**
             * Format: int64
             * @description Seeds everything that is drawn at random.
             * @example 0
             */
            seed?: number;
            /**
             * Format: double
             * @description The thickness of a shell, in units of the mesh; without it the tetrahedra of a solid vibrate.
             * @example 0.001
             */
            thickness?: number | null;
            /**
             * Format: double
             * @description Largest residual of `hsim`.
             * @example 0.001
             */
            tolerance?: number | null;
        };
        /** @description HSIM: modes to a tolerance, proven complete, dense. */
        VibrationByHsimShown: {
            clamped?: number[] | components["schemas"]["AbbreviatedList"];
            /**
             * @description Whether a shell is held from turning about edges whose two ends are held: a clamp. Else it turns there without a
             *     moment: a hinge.
             * @example true
             */
            clamped_rotations?: boolean;
            /**
             * @description Modes, rigid motions included.
             * @example 60
             */
            count?: number;
            /** @description What the object is made of. */
            material?: components["schemas"]["Material"];
            /**
             * @description How it is computed.
             * @enum {string}
             */
            method?: "hsim";
            /**
             * Format: int64
             * @description Seeds everything that is drawn at random.
             * @example 0
             */
            seed?: number;
            /**
             * Format: double
             * @description The thickness of a shell, in units of the mesh; without it the tetrahedra of a solid vibrate.
             * @example 0.001
             */
            thickness?: number | null;
            /**
             * Format: double
             * @description Largest residual of `hsim`.
             * @example 0.001
             */
            tolerance?: number | null;
        };
        /** @description What is known of vibration modes: proven by HSIM, or estimated for the approximation. */
        VibrationCertificate: components["schemas"]["ProvenModes"] | components["schemas"]["EstimatedModes"];
        /**
         * @description How much each eigenvalue counts.
         * @enum {string}
         */
        WeightingName: "index" | "none";
        /** @description Weights of the energies, on the surface of unit area. */
        Weights: {
            /**
             * Format: double
             * @description Of the biharmonic energy, without which a field has no value at a point: with 0 the answer to strokes and
             *     constraints on single faces depends on how fine the mesh is, and in the space of the basis on its dimension. By
             *     default a twentieth of `harmonic`.
             */
            biharmonic?: number | null;
            /**
             * @description Which biharmonic energy: that of the projected Laplacian, which fields of the space can make small, or the full
             *     (unreduced) one of the whole mesh restricted to the space, which sees the noise of its columns. The second is
             *     for comparison; every choice of weights costs a factorisation.
             */
            biharmonic_energy?: components["schemas"]["BiharmonicEnergy"];
            /**
             * Format: double
             * @description Of the harmonic (Dirichlet) energy. By default `1.0`.
             */
            harmonic?: number;
        };
        /** @description Workers that have the same. */
        WorkerClass: {
            /** @description The kinds of job that they take; all where it is empty. */
            kinds: string[];
            /**
             * Format: int64
             * @description Bytes of memory that the jobs of one of them may need together.
             */
            memory_bytes: number;
            /**
             * Format: int64
             * @description How many they are.
             */
            processes: number;
            /**
             * Format: int64
             * @description Jobs that they run at once, all together.
             */
            seats: number;
            /** @description The version of their solver. */
            solver_version: string;
        };
    };
    responses: {
        /** @description A problem: scope-missing or origin-not-allowed */
        Forbidden: {
            headers: {
                [name: string]: unknown;
            };
            content: {
                "application/problem+json": components["schemas"]["Problem"];
            };
        };
        /** @description A problem: internal-error, with the request id in `X-Request-Id` */
        InternalError: {
            headers: {
                [name: string]: unknown;
            };
            content: {
                "application/problem+json": components["schemas"]["Problem"];
            };
        };
        /** @description A problem: unauthenticated */
        Unauthenticated: {
            headers: {
                [name: string]: unknown;
            };
            content: {
                "application/problem+json": components["schemas"]["Problem"];
            };
        };
    };
    parameters: never;
    requestBodies: never;
    headers: never;
    pathItems: never;
}
export type $defs = Record<string, never>;
export interface operations {
    docs: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The page */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    /** @example <!doctype html>… */
                    "text/html": string;
                };
            };
            500: components["responses"]["InternalError"];
        };
    };
    health: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The process answers */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["Health"];
                };
            };
            500: components["responses"]["InternalError"];
        };
    };
    metrics: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The metrics */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    /**
                     * @example # TYPE chladni_http_requests_total counter
                     *     chladni_http_requests_total{method="GET",route="/v1/jobs",status="200"} 3
                     */
                    "text/plain; version=0.0.4": string;
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            500: components["responses"]["InternalError"];
        };
    };
    openapi: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The document */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    /**
                     * @example {
                     *       "info": {
                     *         "title": "Chladni"
                     *       },
                     *       "openapi": "3.1.0"
                     *     }
                     */
                    "application/json": Record<string, never>;
                };
            };
            500: components["responses"]["InternalError"];
        };
    };
    problems: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The page */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    /** @example <!doctype html>… */
                    "text/html": string;
                };
            };
            500: components["responses"]["InternalError"];
        };
    };
    problem: {
        parameters: {
            query?: never;
            header?: never;
            path: {
                /**
                 * @description The kind
                 * @example job-too-large
                 */
                kind: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The page */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    /** @example <!doctype html>… */
                    "text/html": string;
                };
            };
            /** @description A problem: not-found */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
        };
    };
    ready: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The server takes work */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["Readiness"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: not-ready */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    listBases: {
        parameters: {
            query?: {
                /** @description `next` of the page before. */
                from?: string;
                /**
                 * @description Only bases of this kind.
                 * @example eigenbasis
                 */
                kind?: string;
                /** @description Items of the page, at most 200. */
                limit?: number;
                /** @description Only bases on this mesh, or of this problem. */
                mesh?: string;
            };
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description A page of bases */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["PageOf_BasisSummary"];
                };
            };
            /** @description A problem: invalid-query or invalid-cursor */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            500: components["responses"]["InternalError"];
        };
    };
    showBasis: {
        parameters: {
            query?: never;
            header?: never;
            path: {
                /**
                 * @description The id of the basis
                 * @example 019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The basis */
            200: {
                headers: {
                    ETag?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["BasisResource"];
                };
            };
            /** @description The basis is as `If-None-Match` names it */
            304: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
        };
    };
    deleteBasis: {
        parameters: {
            query?: never;
            header?: {
                /**
                 * @description Only where this is the `ETag` of the present state
                 * @example W/"0f6d2c4ab1e84cf2"
                 */
                "If-Match"?: string | null;
            };
            path: {
                /**
                 * @description The id of the basis
                 * @example 019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The basis is gone */
            204: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-in-use */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: precondition-failed */
            412: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: storage-busy or storage-unavailable */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: storage-full */
            507: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    compress: {
        parameters: {
            query?: {
                /** @description The type of the numbers of a raw body. */
                dtype?: "f32" | "f64";
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
                /**
                 * @description For a raw body, the rest of the request as JSON.
                 * @example {"pairs": 300, "bits": 14}
                 */
                request?: string;
            };
            header?: never;
            path: {
                /**
                 * @description The id of the basis
                 * @example 019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10
                 */
                id: string;
            };
            cookie?: never;
        };
        /** @description The functions */
        requestBody: {
            content: {
                "application/json": components["schemas"]["CompressionRequest"];
                "application/octet-stream": Blob;
            };
        };
        responses: {
            /** @description Rate and distortion, or the bytes */
            200: {
                headers: {
                    "Chladni-Relative-Error"?: string;
                    "Server-Timing"?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["CompressionAnswer"];
                    "application/octet-stream": Blob;
                };
            };
            /** @description A problem: invalid-query, damaged-content-encoding, body-incomplete or invalid-json */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind or basis-without-mesh */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request, invalid-function or invalid-analysis */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getBasisContent: {
        parameters: {
            query?: {
                /** @description Takes the place of `Accept`. */
                format?: "npz" | "safetensors" | "matrix_market";
            };
            header?: {
                /**
                 * @description `redirect`: an NPZ is rather fetched from the object store, where the server keeps content in one
                 * @example redirect
                 */
                Prefer?: string | null;
                /**
                 * @description One range of bytes
                 * @example bytes=0-1023
                 */
                Range?: string | null;
            };
            path: {
                /**
                 * @description The id of the basis
                 * @example 019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The whole content */
            200: {
                headers: {
                    ETag?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/octet-stream": Blob;
                    "application/x-matrix-market+zip": Blob;
                    "application/x-npz": Blob;
                    "application/x-safetensors": Blob;
                    "application/zip": Blob;
                };
            };
            /** @description The bytes that `Range` asks for */
            206: {
                headers: {
                    "Content-Range"?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/octet-stream": Blob;
                    "application/x-matrix-market+zip": Blob;
                    "application/x-npz": Blob;
                    "application/x-safetensors": Blob;
                    "application/zip": Blob;
                };
            };
            /** @description The content is as `If-None-Match` names it */
            304: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description With `Prefer: redirect`: where the NPZ lies, for five minutes. Whoever has this address needs no key; `ETag` is the BLAKE3 hash of what it gives */
            307: {
                headers: {
                    ETag?: string;
                    Location?: string;
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: range-not-satisfiable */
            416: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
        };
    };
    decompress: {
        parameters: {
            query?: {
                /** @description The type of the numbers of a raw answer. */
                dtype?: "f32" | "f64";
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
            };
            header?: never;
            path: {
                /**
                 * @description The id of the basis
                 * @example 019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10
                 */
                id: string;
            };
            cookie?: never;
        };
        /** @description Compressed functions */
        requestBody: {
            content: {
                "application/octet-stream": Blob;
            };
        };
        responses: {
            /** @description The functions */
            200: {
                headers: {
                    "Chladni-Columns"?: number;
                    "Chladni-Dtype"?: string;
                    "Chladni-Rows"?: number;
                    "Server-Timing"?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["Table"];
                    "application/octet-stream": Blob;
                    "model/gltf-binary": Blob;
                    "model/obj": Blob;
                    "model/ply": Blob;
                };
            };
            /** @description A problem: invalid-query, damaged-content-encoding or body-incomplete */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind or basis-without-mesh */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-compressed-functions */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    designField: {
        parameters: {
            query?: {
                /** @description How the numbers of a raw answer are written; JSON has them in single precision. */
                encoding?: "f32" | "f16" | "octahedral";
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description Lifts the field to the faces and says how it is written. Without it JSON has the coefficients alone; raw
                 *     answers, and those to requests with `faces`, are in `world` form.
                 */
                form?: "world" | "frames" | "roots" | "axes";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
                /** @description Whether to tell the singular vertices. Takes a pass over all vertices. */
                singularities?: boolean;
            };
            header?: never;
            path: {
                /**
                 * @description The id of the basis
                 * @example 019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["DesignRequest"];
            };
        };
        responses: {
            /** @description The field */
            200: {
                headers: {
                    "Chladni-Columns"?: number;
                    "Chladni-Dtype"?: string;
                    "Chladni-Energies"?: string;
                    "Chladni-Error"?: number;
                    "Chladni-Matching"?: number;
                    "Chladni-Residual"?: number;
                    "Chladni-Rows"?: number;
                    "Chladni-Space"?: string;
                    "Server-Timing"?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["DesignAnswer"];
                    "application/octet-stream": Blob;
                };
            };
            /** @description A problem: invalid-query, damaged-content-encoding, body-incomplete or invalid-json */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis or unknown-field */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind or basis-without-mesh */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request, invalid-design or no-field-surface */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    saveDesign: {
        parameters: {
            query?: {
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
            };
            header?: never;
            path: {
                /**
                 * @description The id of the basis
                 * @example 019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["SaveDesignRequest"];
            };
        };
        responses: {
            /** @description An equal field was stored before */
            200: {
                headers: {
                    Location?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["FieldResource"];
                };
            };
            /** @description The field is stored; `Location` names it */
            201: {
                headers: {
                    ETag?: string;
                    Location?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["FieldResource"];
                };
            };
            /** @description A problem: invalid-query, damaged-content-encoding, body-incomplete or invalid-json */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis or unknown-field */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind or basis-without-mesh */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request, invalid-design or no-field-surface */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy, storage-busy, storage-unavailable or draining */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: storage-full */
            507: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    distances: {
        parameters: {
            query?: {
                /** @description The type of the numbers of a raw answer. */
                dtype?: "f32" | "f64";
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
                /** @description Whether the numbers of a raw body are pairs, not sources. */
                pairs?: boolean;
                /**
                 * @description For a raw body, the rest of the request as JSON.
                 * @example {"distance": {"kind": "biharmonic"}}
                 */
                request?: string;
            };
            header?: never;
            path: {
                /**
                 * @description The id of the basis
                 * @example 019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10
                 */
                id: string;
            };
            cookie?: never;
        };
        /** @description The sources or pairs */
        requestBody: {
            content: {
                "application/json": components["schemas"]["DistanceRequest"];
                "application/octet-stream": Blob;
            };
        };
        responses: {
            /** @description The distances */
            200: {
                headers: {
                    "Chladni-Columns"?: number;
                    "Chladni-Dtype"?: string;
                    "Chladni-Rows"?: number;
                    "Chladni-Slope-Error"?: number;
                    "Server-Timing"?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["Table"];
                    "application/octet-stream": Blob;
                };
            };
            /** @description A problem: invalid-query, damaged-content-encoding, body-incomplete or invalid-json */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind or basis-without-mesh */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request, invalid-vertex or invalid-analysis */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getEigenfields: {
        parameters: {
            query?: {
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /** @description How the numbers of a face are written. */
                form?: "world" | "frames" | "roots" | "axes";
                /**
                 * @description The first field, counted from 0.
                 * @example 0
                 */
                from?: number;
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
                /**
                 * @description Corrects the fields among all fields of the surface until their eigenvalues are estimated to be right to this
                 *     share of them: 1e-10 to below 1.
                 * @example 0.001
                 */
                refine?: number;
                /**
                 * @description One past the last field; without it, the one after `from`.
                 * @example 4
                 */
                to?: number;
            };
            header?: never;
            path: {
                /**
                 * @description The id of the basis
                 * @example 019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The fields */
            200: {
                headers: {
                    "Chladni-Columns"?: number;
                    "Chladni-Dtype"?: string;
                    "Chladni-Eigenvalues"?: string;
                    "Chladni-Estimates"?: string;
                    "Chladni-Rows"?: number;
                    [name: string]: unknown;
                };
                content: {
                    "application/octet-stream": Blob;
                    "application/x-npy": Blob;
                };
            };
            /** @description A problem: invalid-query, damaged-content-encoding or body-incomplete */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind or basis-without-mesh */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-mode-range, invalid-design or no-field-surface */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    filter: {
        parameters: {
            query?: {
                /** @description The type of the numbers of a raw body and of a raw answer. */
                dtype?: "f32" | "f64";
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /** @description `coordinates`, instead of a body. */
                function?: "coordinates";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
                /** @description Onto how many modes functions are projected, for a raw body; all by default. */
                pairs?: number;
                /** @description Whether to give the projected functions instead of the coefficients. */
                reconstruct?: boolean;
                /**
                 * @description The transfer function as JSON, for a raw body.
                 * @example {"kind": "low_pass", "cutoff": 250.0}
                 */
                transfer?: string;
            };
            header?: never;
            path: {
                /**
                 * @description The id of the basis
                 * @example 019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10
                 */
                id: string;
            };
            cookie?: never;
        };
        /** @description The functions */
        requestBody: {
            content: {
                "application/json": components["schemas"]["FilterRequest"];
                "application/octet-stream": Blob;
            };
        };
        responses: {
            /** @description The filtered functions: a row for each vertex; of three functions, also the mesh with them as its coordinates */
            200: {
                headers: {
                    "Chladni-Columns"?: number;
                    "Chladni-Dtype"?: string;
                    "Chladni-Rows"?: number;
                    "Server-Timing"?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["Table"];
                    "application/octet-stream": Blob;
                    "model/gltf-binary": Blob;
                    "model/obj": Blob;
                    "model/ply": Blob;
                };
            };
            /** @description A problem: invalid-query, damaged-content-encoding, body-incomplete or invalid-json */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind or basis-without-mesh */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request, invalid-function or invalid-transfer-function */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    combFur: {
        parameters: {
            query?: {
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
            };
            header?: never;
            path: {
                /**
                 * @description The id of the basis
                 * @example 019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["FurRequest"];
            };
        };
        responses: {
            /** @description The strands: a row for each face, or for each of `strands` */
            200: {
                headers: {
                    "Chladni-Columns"?: number;
                    "Chladni-Dtype"?: string;
                    "Chladni-Rows"?: number;
                    [name: string]: unknown;
                };
                content: {
                    /**
                     * @example {
                     *       "columns": 6,
                     *       "values": [
                     *         0.1,
                     *         0.2,
                     *         0.3,
                     *         0,
                     *         0.01,
                     *         0.04
                     *       ]
                     *     }
                     */
                    "application/json": components["schemas"]["Table"];
                    "application/octet-stream": Blob;
                    "image/png": Blob;
                };
            };
            /** @description A problem: invalid-query, damaged-content-encoding, body-incomplete or invalid-json */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis or unknown-field */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind or basis-without-mesh */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request, invalid-design or no-field-surface */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    drawHatching: {
        parameters: {
            query?: {
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
            };
            header?: never;
            path: {
                /**
                 * @description The id of the basis
                 * @example 019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["HatchingRequest"];
            };
        };
        responses: {
            /** @description The lines */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["HatchingAnswer"];
                    "image/png": Blob;
                    "image/svg+xml": string;
                };
            };
            /** @description A problem: invalid-query, damaged-content-encoding, body-incomplete or invalid-json */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis or unknown-field */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind or basis-without-mesh */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request, invalid-design or no-field-surface */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getMaps: {
        parameters: {
            query?: {
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /** @description Whether the answer has the matrices beside the points. */
                matrices?: boolean;
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
                /**
                 * @description Only the maps from this shape, by its place among the bases of the job.
                 * @example 0
                 */
                source?: number;
                /**
                 * @description Only the maps to this shape.
                 * @example 1
                 */
                target?: number;
            };
            header?: never;
            path: {
                /**
                 * @description The id of the basis
                 * @example 019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The maps */
            200: {
                headers: {
                    "Server-Timing"?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["MapCollectionAnswer"];
                };
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis or unknown-mesh */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getModes: {
        parameters: {
            query?: {
                /** @description The type of the numbers. */
                dtype?: "f32" | "f64";
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /** @description Takes the place of `Accept`. */
                format?: "npy" | "f32" | "ply";
                /**
                 * @description The first mode, counted from 0.
                 * @example 1
                 */
                from?: number;
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
                /**
                 * @description One past the last mode; without it, all from `from` on (for PLY, that one).
                 * @example 11
                 */
                to?: number;
            };
            header?: never;
            path: {
                /**
                 * @description The id of the basis
                 * @example 019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The modes */
            200: {
                headers: {
                    "Chladni-Columns"?: number;
                    "Chladni-Dtype"?: string;
                    "Chladni-Rows"?: number;
                    ETag?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/octet-stream": Blob;
                    "application/x-npy": Blob;
                    "model/ply": Blob;
                };
            };
            /** @description The modes are as `If-None-Match` names them */
            304: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind or basis-without-mesh */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: range-not-satisfiable */
            416: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-mode-range */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    project: {
        parameters: {
            query?: {
                /** @description The type of the numbers of a raw body and of a raw answer. */
                dtype?: "f32" | "f64";
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /** @description `coordinates`, instead of a body. */
                function?: "coordinates";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
                /** @description Onto how many modes functions are projected, for a raw body; all by default. */
                pairs?: number;
                /** @description Whether to give the projected functions instead of the coefficients. */
                reconstruct?: boolean;
                /**
                 * @description The transfer function as JSON, for a raw body.
                 * @example {"kind": "low_pass", "cutoff": 250.0}
                 */
                transfer?: string;
            };
            header?: never;
            path: {
                /**
                 * @description The id of the basis
                 * @example 019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10
                 */
                id: string;
            };
            cookie?: never;
        };
        /** @description The functions */
        requestBody: {
            content: {
                "application/json": components["schemas"]["ProjectRequest"];
                "application/octet-stream": Blob;
            };
        };
        responses: {
            /** @description The coefficients; of three functions, also the mesh with the projected ones as its coordinates */
            200: {
                headers: {
                    "Chladni-Columns"?: number;
                    "Chladni-Dtype"?: string;
                    "Chladni-Relative-Error"?: string;
                    "Chladni-Rows"?: number;
                    "Server-Timing"?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["ProjectAnswer"];
                    "application/octet-stream": Blob;
                    "model/gltf-binary": Blob;
                    "model/obj": Blob;
                    "model/ply": Blob;
                };
            };
            /** @description A problem: invalid-query, damaged-content-encoding, body-incomplete or invalid-json */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind or basis-without-mesh */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request, invalid-function or invalid-analysis */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    reconstruct: {
        parameters: {
            query?: {
                /** @description The type of the numbers of a raw body and of a raw answer */
                dtype?: "f32" | "f64";
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
            };
            header?: never;
            path: {
                /**
                 * @description The id of the basis
                 * @example 019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10
                 */
                id: string;
            };
            cookie?: never;
        };
        /** @description The coefficients */
        requestBody: {
            content: {
                /**
                 * @example {
                 *       "columns": 1,
                 *       "values": [
                 *         0.49,
                 *         0.01,
                 *         -0.02
                 *       ]
                 *     }
                 */
                "application/json": components["schemas"]["Table"];
                "application/octet-stream": Blob;
            };
        };
        responses: {
            /** @description The functions: a row for each vertex */
            200: {
                headers: {
                    "Chladni-Columns"?: number;
                    "Chladni-Dtype"?: string;
                    "Chladni-Rows"?: number;
                    "Server-Timing"?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["Table"];
                    "application/octet-stream": Blob;
                };
            };
            /** @description A problem: invalid-query, damaged-content-encoding, body-incomplete or invalid-json */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind or basis-without-mesh */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request or invalid-function */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    signatures: {
        parameters: {
            query?: {
                /** @description The type of the numbers of a raw answer. */
                dtype?: "f32" | "f64";
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
                /**
                 * @description For a raw body, the rest of the request as JSON.
                 * @example {"signature": {"kind": "wave_kernel"}}
                 */
                request?: string;
            };
            header?: never;
            path: {
                /**
                 * @description The id of the basis
                 * @example 019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10
                 */
                id: string;
            };
            cookie?: never;
        };
        /** @description The vertices */
        requestBody: {
            content: {
                "application/json": components["schemas"]["SignatureRequest"];
                "application/octet-stream": Blob;
            };
        };
        responses: {
            /** @description The signatures */
            200: {
                headers: {
                    "Chladni-Columns"?: number;
                    "Chladni-Dtype"?: string;
                    "Chladni-Rows"?: number;
                    "Server-Timing"?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["Table"];
                    "application/octet-stream": Blob;
                };
            };
            /** @description A problem: invalid-query, damaged-content-encoding, body-incomplete or invalid-json */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind or basis-without-mesh */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request, invalid-vertex or invalid-analysis */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    similarPoints: {
        parameters: {
            query?: {
                /** @description The type of the numbers of a raw answer. */
                dtype?: "f32" | "f64";
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
                /**
                 * @description For a raw body, the rest of the request as JSON.
                 * @example {"signature": {"kind": "wave_kernel"}}
                 */
                request?: string;
            };
            header?: never;
            path: {
                /**
                 * @description The id of the basis
                 * @example 019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10
                 */
                id: string;
            };
            cookie?: never;
        };
        /** @description The point */
        requestBody: {
            content: {
                "application/json": components["schemas"]["SimilarRequest"];
                "application/octet-stream": Blob;
            };
        };
        responses: {
            /** @description Similar points, or the difference of every vertex */
            200: {
                headers: {
                    "Chladni-Columns"?: number;
                    "Chladni-Dtype"?: string;
                    "Chladni-Rows"?: number;
                    "Server-Timing"?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["SimilarAnswer"];
                    "application/octet-stream": Blob;
                };
            };
            /** @description A problem: invalid-query, damaged-content-encoding, body-incomplete or invalid-json */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind or basis-without-mesh */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request, invalid-vertex or invalid-analysis */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    simulate: {
        parameters: {
            query?: {
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
            };
            header?: never;
            path: {
                /**
                 * @description The id of the basis
                 * @example 019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["SimulateRequest"];
            };
        };
        responses: {
            /** @description The motion, frames, or a sound */
            200: {
                headers: {
                    "Chladni-Columns"?: number;
                    /** @description Of frames and sounds: how many impulses and forces do nothing, as their vertex is held */
                    "Chladni-Held-Loads"?: number;
                    "Chladni-Peak"?: number;
                    "Chladni-Rows"?: number;
                    "Server-Timing"?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["SimulateAnswer"];
                    "application/octet-stream": Blob;
                    "audio/wav": Blob;
                };
            };
            /** @description A problem: invalid-query, damaged-content-encoding, body-incomplete or invalid-json */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind or basis-without-mesh */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request or invalid-simulation */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    familySpectrum: {
        parameters: {
            query?: {
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
            };
            header?: never;
            path: {
                /**
                 * @description The id of the basis
                 * @example 019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["SpectrumRequest"];
            };
        };
        responses: {
            /** @description The pairs */
            200: {
                headers: {
                    "Chladni-Columns"?: number;
                    "Chladni-Covered"?: number;
                    "Chladni-Eigenvalues"?: string;
                    "Chladni-Rows"?: number;
                    "Server-Timing"?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["SpectrumAnswer"];
                    "application/octet-stream": Blob;
                };
            };
            /** @description A problem: invalid-query, damaged-content-encoding, body-incomplete or invalid-json */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind or basis-without-mesh */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request or invalid-spectrum */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    valueGradient: {
        parameters: {
            query?: {
                /** @description The type of the numbers of a raw answer. */
                dtype?: "f32" | "f64";
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
            };
            header?: never;
            path: {
                /**
                 * @description The id of the basis
                 * @example 019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10
                 */
                id: string;
            };
            cookie?: never;
        };
        /** @description The weights */
        requestBody: {
            content: {
                "application/json": components["schemas"]["ValueGradientRequest"];
                "application/octet-stream": Blob;
            };
        };
        responses: {
            /** @description The gradient */
            200: {
                headers: {
                    "Chladni-Columns"?: number;
                    "Chladni-Dtype"?: string;
                    "Chladni-Rows"?: number;
                    "Server-Timing"?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["Table"];
                    "application/octet-stream": Blob;
                };
            };
            /** @description A problem: invalid-query, damaged-content-encoding, body-incomplete or invalid-json */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind or basis-without-mesh */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request, invalid-function or invalid-analysis */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    verifyBasis: {
        parameters: {
            query?: never;
            header?: never;
            path: {
                /**
                 * @description The id of the basis
                 * @example 019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The receipt */
            200: {
                headers: {
                    "Server-Timing"?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["VerificationReceipt"];
                };
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind or basis-without-mesh */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-analysis */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    compareBases: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["BasisComparisonRequest"];
            };
        };
        responses: {
            /** @description The comparison */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["BasisComparisonAnswer"];
                };
            };
            /** @description A problem: damaged-content-encoding, body-incomplete, invalid-json or invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind or incomparable-bases */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request or invalid-analysis */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    listFields: {
        parameters: {
            query?: {
                /** @description Only fields that were designed in this basis. */
                basis?: string;
                /** @description `next` of the page before. */
                from?: string;
                /** @description Items of the page, at most 200. */
                limit?: number;
                /** @description Only fields on this mesh. */
                mesh?: string;
                /**
                 * @description Only fields whose name contains this, in capital letters or small ones.
                 * @example combed
                 */
                name?: string;
            };
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description A page of fields */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["PageOf_FieldSummary"];
                };
            };
            /** @description A problem: invalid-query or invalid-cursor */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            500: components["responses"]["InternalError"];
        };
    };
    showField: {
        parameters: {
            query?: {
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
            };
            header?: never;
            path: {
                /**
                 * @description The id of the field
                 * @example 5c1f7e0a93b84d6f8e21a7b0c4d95f36
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The field */
            200: {
                headers: {
                    ETag?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["FieldResource"];
                };
            };
            /** @description The field is as `If-None-Match` names it */
            304: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-field */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
        };
    };
    deleteField: {
        parameters: {
            query?: never;
            header?: {
                /**
                 * @description Only where this is the `ETag` of the present state
                 * @example W/"0f6d2c4ab1e84cf2"
                 */
                "If-Match"?: string | null;
            };
            path: {
                /**
                 * @description The id of the field
                 * @example 5c1f7e0a93b84d6f8e21a7b0c4d95f36
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The field is gone */
            204: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-field */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: precondition-failed */
            412: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: storage-busy or storage-unavailable */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: storage-full */
            507: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    renameField: {
        parameters: {
            query?: {
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
            };
            header?: {
                /**
                 * @description Only where this is the `ETag` of the present state
                 * @example W/"0f6d2c4ab1e84cf2"
                 */
                "If-Match"?: string | null;
            };
            path: {
                /**
                 * @description The id of the field
                 * @example 5c1f7e0a93b84d6f8e21a7b0c4d95f36
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["RenameRequest"];
            };
        };
        responses: {
            /** @description The field under its new name */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["FieldResource"];
                };
            };
            /** @description A problem: damaged-content-encoding, body-incomplete, invalid-json or invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-field */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: precondition-failed */
            412: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy, storage-busy or storage-unavailable */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: storage-full */
            507: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getFieldContent: {
        parameters: {
            query?: {
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description How the numbers of a face of a design are written, `world` where it is left out. Uploads are given back as they
                 *     are.
                 */
                form?: "world" | "frames" | "roots" | "axes";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
            };
            header?: never;
            path: {
                /**
                 * @description The id of the field
                 * @example 5c1f7e0a93b84d6f8e21a7b0c4d95f36
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The numbers */
            200: {
                headers: {
                    "Chladni-Columns"?: number;
                    "Chladni-Dtype"?: string;
                    "Chladni-Rows"?: number;
                    [name: string]: unknown;
                };
                content: {
                    /**
                     * @example {
                     *       "columns": 3,
                     *       "values": [
                     *         0.4,
                     *         0.3,
                     *         0
                     *       ]
                     *     }
                     */
                    "application/json": components["schemas"]["Table"];
                    "application/octet-stream": Blob;
                    "application/x-npy": Blob;
                };
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-field or unknown-mesh */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: no-field-surface */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    functionalMap: {
        parameters: {
            query?: {
                /** @description The type of the numbers of a raw answer. */
                dtype?: "f32" | "f64";
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
                /** @description Whether a raw answer is the matched points as little-endian u32, not the matrix. */
                points?: boolean;
                /** @description For a raw body, the rest of the request as JSON. */
                request?: string;
            };
            header?: never;
            path?: never;
            cookie?: never;
        };
        /** @description The surfaces and what is known */
        requestBody: {
            content: {
                "application/json": components["schemas"]["FunctionalMapRequest"];
                "application/octet-stream": Blob;
            };
        };
        responses: {
            /** @description The map */
            200: {
                headers: {
                    "Chladni-Columns"?: number;
                    "Chladni-Dtype"?: string;
                    "Chladni-Rows"?: number;
                    "Server-Timing"?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["FunctionalMapAnswer"];
                    "application/octet-stream": Blob;
                };
            };
            /** @description A problem: invalid-query, damaged-content-encoding, body-incomplete or invalid-json */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind, basis-without-mesh or incomparable-bases */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request, invalid-vertex, invalid-function or invalid-analysis */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    estimateJob: {
        parameters: {
            query?: {
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
            };
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["JobRequest"];
            };
        };
        responses: {
            /** @description What it would take */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["JobEstimate"];
                };
            };
            /** @description A problem: damaged-content-encoding, body-incomplete, invalid-json or invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-mesh, unknown-problem or unknown-basis */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind or incomparable-bases */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request or invalid-parameter */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    listJobs: {
        parameters: {
            query?: {
                /** @description `next` of the page before. */
                from?: string;
                /**
                 * @description Only jobs of this kind.
                 * @example eigenbasis
                 */
                kind?: string;
                /** @description Items of the page, at most 200. */
                limit?: number;
                /** @description Only jobs on this mesh, or on the problem that has this id. */
                mesh?: string;
                /** @description Only the parts of this job, while it is divided: no other list has them, but that of the kind `eigenbasis_part`. */
                parent?: string;
                /** @description Only jobs with this status. */
                status?: "enqueued" | "processing" | "succeeded" | "failed" | "canceled";
            };
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description A page of jobs */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["PageOf_JobResource"];
                };
            };
            /** @description A problem: invalid-query or invalid-cursor */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            500: components["responses"]["InternalError"];
        };
    };
    submitJob: {
        parameters: {
            query?: {
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
                /**
                 * @description Answer only when the job has ended, or after this time (`20s`, `1500ms`; at most a minute).
                 * @example 20s
                 */
                wait?: string;
            };
            header?: {
                /**
                 * @description 1 to 200 visible ASCII characters that stand for this request
                 * @example 8f14e45f
                 */
                "Idempotency-Key"?: string | null;
            };
            path?: never;
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["JobRequest"];
            };
        };
        responses: {
            /** @description Equal work was already done, or the job ended during the wait: the job, with its basis or the reason why there is none */
            200: {
                headers: {
                    Location?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["JobResource"];
                };
            };
            /** @description The job is stored; `Location` names it and `Retry-After` says when to look */
            202: {
                headers: {
                    /** @description created, same-work or replayed */
                    "Chladni-Outcome"?: string;
                    Location?: string;
                    "Retry-After"?: number;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["JobResource"];
                };
            };
            /** @description A problem: damaged-content-encoding, body-incomplete, invalid-json, invalid-query or invalid-header */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-mesh, unknown-problem or unknown-basis */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind, incomparable-bases or idempotency-conflict */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request, invalid-parameter or job-too-large */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: queue-full */
            429: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy, storage-busy, storage-unavailable or draining */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: storage-full */
            507: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    showJob: {
        parameters: {
            query?: {
                /**
                 * @description Answer only when the job has ended, or after this time (`20s`, `1500ms`; at most a minute). With
                 *     `If-None-Match`: when it has changed.
                 * @example 20s
                 */
                wait?: string;
            };
            header?: never;
            path: {
                /**
                 * @description The id of the job
                 * @example 019aa5d0-5c3e-7c11-8a53-3a0f1c7ce1f2
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The job */
            200: {
                headers: {
                    ETag?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["JobResource"];
                };
            };
            /** @description The job is as `If-None-Match` names it */
            304: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-job */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    deleteJob: {
        parameters: {
            query?: {
                /** @description Deletes its basis too. */
                cascade?: boolean;
            };
            header?: {
                /**
                 * @description Only where this is the `ETag` of the present state
                 * @example W/"0f6d2c4ab1e84cf2"
                 */
                "If-Match"?: string | null;
            };
            path: {
                /**
                 * @description The id of the job
                 * @example 019aa5d0-5c3e-7c11-8a53-3a0f1c7ce1f2
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The job is gone */
            204: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-job */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: state-conflict or basis-in-use */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: precondition-failed */
            412: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: storage-busy or storage-unavailable */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: storage-full */
            507: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    cancelJob: {
        parameters: {
            query?: never;
            header?: never;
            path: {
                /**
                 * @description The id of the job
                 * @example 019aa5d0-5c3e-7c11-8a53-3a0f1c7ce1f2
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The job, canceled or asked to stop */
            202: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["JobResource"];
                };
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-job */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: state-conflict */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: storage-busy or storage-unavailable */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: storage-full */
            507: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    watchJob: {
        parameters: {
            query?: never;
            header?: {
                /**
                 * @description The revision that the client has seen; what is no number stands for none
                 * @example 7
                 */
                "Last-Event-ID"?: string | null;
            };
            path: {
                /**
                 * @description The id of the job
                 * @example 019aa5d0-5c3e-7c11-8a53-3a0f1c7ce1f2
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The stream */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    /**
                     * @example event: job
                     *     id: 8
                     *     data: {"id":"019aa5d0-5c3e-7c11-8a53-3a0f1c7ce1f2","status":"processing","stage":"eigen","progress":0.5}
                     */
                    "text/event-stream": unknown;
                };
            };
            /** @description The job has ended, and the client has seen it */
            204: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-job */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    retryJob: {
        parameters: {
            query?: never;
            header?: never;
            path: {
                /**
                 * @description The id of the job
                 * @example 019aa5d0-5c3e-7c11-8a53-3a0f1c7ce1f2
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The job, waiting again */
            202: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["JobResource"];
                };
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-job, unknown-mesh, unknown-problem or unknown-basis */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: state-conflict */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: storage-busy, storage-unavailable or draining */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: storage-full */
            507: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    mapCollection: {
        parameters: {
            query?: {
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
            };
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["MapCollectionRequest"];
            };
        };
        responses: {
            /** @description The maps */
            200: {
                headers: {
                    "Server-Timing"?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["MapCollectionAnswer"];
                };
            };
            /** @description A problem: invalid-query, damaged-content-encoding, body-incomplete or invalid-json */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind, basis-without-mesh or incomparable-bases */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request, invalid-parameter or invalid-analysis */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    listMeshes: {
        parameters: {
            query?: {
                /** @description `next` of the page before. */
                from?: string;
                /** @description Items of the page, at most 200. */
                limit?: number;
                /**
                 * @description Only meshes whose name contains this, in capital letters or small ones.
                 * @example bunny
                 */
                name?: string;
            };
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description A page of meshes */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["PageOf_MeshResource"];
                };
            };
            /** @description A problem: invalid-query or invalid-cursor */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            500: components["responses"]["InternalError"];
        };
    };
    uploadMesh: {
        parameters: {
            query?: {
                /**
                 * @description The format: `obj`, `ply`, `off`, `stl`, `medit`, `vtk`, `gmsh`, `freesurfer`, `gltf`, `gifti`, `npz` or `json`.
                 *     Takes the place of `Content-Type`.
                 * @example ply
                 */
                format?: string;
                /**
                 * @description Whether vertices at exactly equal positions become one: `auto` (where the format repeats positions by design, as
                 *     STL does), `always` or `never`.
                 * @example auto
                 */
                merge?: "auto" | "always" | "never";
                /**
                 * @description A name for people, at most 200 characters.
                 * @example igea
                 */
                name?: string;
                /**
                 * @description How often every face is divided into four before the mesh is stored, 0 to 6. Eigenvalues of the finer mesh are
                 *     nearer to those of the surface.
                 * @example 0
                 */
                subdivide?: number;
                /**
                 * @description Which surface is meant where a file has triangles and tetrahedra: `boundary`, where its tetrahedra have no
                 *     neighbour (that is closed, and the solid's own), or `given`, its triangles, without an inside. By what the two
                 *     differ is told among the defects.
                 * @example boundary
                 */
                surface?: "boundary" | "given";
            };
            header?: never;
            path?: never;
            cookie?: never;
        };
        /** @description The mesh */
        requestBody: {
            content: {
                "application/json": components["schemas"]["MeshArrays"];
                "application/octet-stream": Blob;
                "application/x-npz": Blob;
                "model/gltf-binary": Blob;
                /**
                 * @example v 0 0 0
                 *     v 1 0 0
                 *     v 0 1 0
                 *     f 1 2 3
                 */
                "model/obj": Blob;
                "model/off": Blob;
                "model/ply": Blob;
                "model/stl": Blob;
                "model/x-freesurfer": Blob;
                "model/x-gifti": Blob;
                "model/x-gmsh": Blob;
                "model/x-medit": Blob;
                "model/x-vtk": Blob;
                "multipart/form-data": components["schemas"]["MeshParts"];
            };
        };
        responses: {
            /** @description The same content was stored before */
            200: {
                headers: {
                    Location?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["MeshResource"];
                };
            };
            /** @description The mesh is stored; `Location` names it */
            201: {
                headers: {
                    ETag?: string;
                    Location?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["MeshResource"];
                };
            };
            /** @description A problem: damaged-content-encoding, body-incomplete, invalid-query or invalid-multipart */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unknown-mesh-format */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unreadable-mesh or unusable-mesh */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy, storage-busy, storage-unavailable or draining */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: storage-full */
            507: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    showMesh: {
        parameters: {
            query?: never;
            header?: never;
            path: {
                /**
                 * @description The id of the mesh
                 * @example 0f6d2c4ab1e84cf29be2e3f0b5d1a7c3
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The mesh */
            200: {
                headers: {
                    ETag?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["MeshResource"];
                };
            };
            /** @description The mesh is as `If-None-Match` names it */
            304: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-mesh */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
        };
    };
    deleteMesh: {
        parameters: {
            query?: {
                /** @description Cancels its unfinished jobs and deletes its bases too. */
                cascade?: boolean;
            };
            header?: {
                /**
                 * @description Only where this is the `ETag` of the present state
                 * @example W/"0f6d2c4ab1e84cf2"
                 */
                "If-Match"?: string | null;
            };
            path: {
                /**
                 * @description The id of the mesh
                 * @example 0f6d2c4ab1e84cf29be2e3f0b5d1a7c3
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The mesh is gone */
            204: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-mesh */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: mesh-in-use */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: precondition-failed */
            412: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: storage-busy or storage-unavailable */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: storage-full */
            507: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    renameMesh: {
        parameters: {
            query?: never;
            header?: {
                /**
                 * @description Only where this is the `ETag` of the present state
                 * @example W/"0f6d2c4ab1e84cf2"
                 */
                "If-Match"?: string | null;
            };
            path: {
                /**
                 * @description The id of the mesh
                 * @example 0f6d2c4ab1e84cf29be2e3f0b5d1a7c3
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["RenameRequest"];
            };
        };
        responses: {
            /** @description The mesh under its new name */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["MeshResource"];
                };
            };
            /** @description A problem: damaged-content-encoding, body-incomplete, invalid-json or invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-mesh */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: precondition-failed */
            412: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy, storage-busy or storage-unavailable */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: storage-full */
            507: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getMeshContent: {
        parameters: {
            query?: {
                /** @description Takes the place of `Accept`. */
                format?: "ply" | "obj" | "glb" | "buffers";
            };
            header?: {
                /**
                 * @description One range of bytes
                 * @example bytes=0-1023
                 */
                Range?: string | null;
            };
            path: {
                /**
                 * @description The id of the mesh
                 * @example 0f6d2c4ab1e84cf29be2e3f0b5d1a7c3
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The whole content */
            200: {
                headers: {
                    ETag?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/octet-stream": Blob;
                    "application/vnd.chladni.mesh": Blob;
                    "model/gltf-binary": Blob;
                    "model/obj": Blob;
                    "model/ply": Blob;
                };
            };
            /** @description The bytes that `Range` asks for */
            206: {
                headers: {
                    "Content-Range"?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/octet-stream": Blob;
                    "application/vnd.chladni.mesh": Blob;
                    "model/gltf-binary": Blob;
                    "model/obj": Blob;
                    "model/ply": Blob;
                };
            };
            /** @description The content is as `If-None-Match` names it */
            304: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-mesh */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: range-not-satisfiable */
            416: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
        };
    };
    meshDistances: {
        parameters: {
            query?: {
                /** @description The type of the numbers of a raw answer. */
                dtype?: "f32" | "f64";
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
                /** @description Whether the numbers of a raw body are pairs, not sources. */
                pairs?: boolean;
                /**
                 * @description For a raw body, the rest of the request as JSON.
                 * @example {"distance": {"kind": "biharmonic"}}
                 */
                request?: string;
            };
            header?: never;
            path: {
                /**
                 * @description The id of the mesh
                 * @example 0f6d2c4ab1e84cf29be2e3f0b5d1a7c3
                 */
                id: string;
            };
            cookie?: never;
        };
        /** @description The sources or pairs */
        requestBody: {
            content: {
                "application/json": components["schemas"]["DistanceRequest"];
                "application/octet-stream": Blob;
            };
        };
        responses: {
            /** @description The distances */
            200: {
                headers: {
                    "Chladni-Columns"?: number;
                    "Chladni-Dtype"?: string;
                    "Chladni-Rows"?: number;
                    "Chladni-Slope-Error"?: number;
                    "Server-Timing"?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["Table"];
                    "application/octet-stream": Blob;
                };
            };
            /** @description A problem: damaged-content-encoding, body-incomplete, invalid-json or invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-mesh */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request, invalid-vertex or invalid-analysis */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getFaceMap: {
        parameters: {
            query?: {
                /** @description Takes the place of `Accept`. */
                format?: "json" | "npy";
                /** @description What there is an entry for: each vertex or face of the file, or each of the mesh. */
                of?: "file" | "kept";
            };
            header?: never;
            path: {
                /**
                 * @description The id of the mesh
                 * @example 0f6d2c4ab1e84cf29be2e3f0b5d1a7c3
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The map */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["MapAnswer"];
                    "application/x-npy": Blob;
                };
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-mesh */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    uploadField: {
        parameters: {
            query?: {
                /** @description Of raw numbers, how many each face has. */
                columns?: number;
                /** @description The type of raw numbers. They are kept in single precision. */
                dtype?: "f32" | "f64";
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description A name for people, at most 200 characters.
                 * @example combed by hand
                 */
                name?: string;
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
            };
            header?: never;
            path: {
                /**
                 * @description The id of the mesh
                 * @example 0f6d2c4ab1e84cf29be2e3f0b5d1a7c3
                 */
                id: string;
            };
            cookie?: never;
        };
        /** @description The numbers */
        requestBody: {
            content: {
                /**
                 * @example {
                 *       "columns": 3,
                 *       "values": [
                 *         0.4,
                 *         0.3,
                 *         0
                 *       ]
                 *     }
                 */
                "application/json": components["schemas"]["Table"];
                "application/octet-stream": Blob;
            };
        };
        responses: {
            /** @description An equal field was stored before */
            200: {
                headers: {
                    Location?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["FieldResource"];
                };
            };
            /** @description The field is stored; `Location` names it */
            201: {
                headers: {
                    ETag?: string;
                    Location?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["FieldResource"];
                };
            };
            /** @description A problem: damaged-content-encoding, body-incomplete, invalid-json or invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-mesh */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request or invalid-design */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy, storage-busy, storage-unavailable or draining */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: storage-full */
            507: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getFrames: {
        parameters: {
            query?: {
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
            };
            header?: never;
            path: {
                /**
                 * @description The id of the mesh
                 * @example 0f6d2c4ab1e84cf29be2e3f0b5d1a7c3
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The frames: a row for each face */
            200: {
                headers: {
                    "Chladni-Columns"?: number;
                    "Chladni-Dtype"?: string;
                    "Chladni-Rows"?: number;
                    [name: string]: unknown;
                };
                content: {
                    /**
                     * @example {
                     *       "columns": 6,
                     *       "values": [
                     *         1,
                     *         0,
                     *         0,
                     *         0,
                     *         1,
                     *         0
                     *       ]
                     *     }
                     */
                    "application/json": components["schemas"]["Table"];
                    "application/octet-stream": Blob;
                };
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-mesh */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: no-field-surface */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    decomposeField: {
        parameters: {
            query?: {
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
            };
            header?: never;
            path: {
                /**
                 * @description The id of the mesh
                 * @example 0f6d2c4ab1e84cf29be2e3f0b5d1a7c3
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["DecompositionRequest"];
            };
        };
        responses: {
            /** @description The parts */
            200: {
                headers: {
                    "Server-Timing"?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["DecompositionAnswer"];
                };
            };
            /** @description A problem: damaged-content-encoding, body-incomplete, invalid-json or invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-mesh */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request, no-field-surface or invalid-design */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    parametriseQuads: {
        parameters: {
            query?: {
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /**
                 * @description The whole answer as JSON, or one file, of the mesh as it is kept: OBJ with texture coordinates, legacy VTK, or
                 *     the field as Directional reads it.
                 */
                format?: "json" | "obj" | "vtk" | "rawfield" | "matching" | "singularities";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
            };
            header?: never;
            path: {
                /**
                 * @description The id of the mesh
                 * @example 0f6d2c4ab1e84cf29be2e3f0b5d1a7c3
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["QuadsRequest"];
            };
        };
        responses: {
            /** @description The coordinates */
            200: {
                headers: {
                    "Server-Timing"?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["QuadsAnswer"];
                    "model/obj": string;
                    "text/plain": string;
                };
            };
            /** @description A problem: invalid-query, damaged-content-encoding, body-incomplete or invalid-json */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis, unknown-mesh or unknown-field */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind or basis-without-mesh */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request, no-field-surface or invalid-design */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    writeMovedSurface: {
        parameters: {
            query?: {
                /** @description The type of the numbers of a raw body. */
                dtype?: "f32" | "f64";
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /** @description Takes the place of `Accept`. */
                format?: "ply" | "obj" | "glb";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
            };
            header?: never;
            path: {
                /**
                 * @description The id of the mesh
                 * @example 0f6d2c4ab1e84cf29be2e3f0b5d1a7c3
                 */
                id: string;
            };
            cookie?: never;
        };
        /** @description The positions */
        requestBody: {
            content: {
                /**
                 * @example {
                 *       "columns": 3,
                 *       "values": [
                 *         0,
                 *         0,
                 *         0.5,
                 *         1,
                 *         0,
                 *         0.5,
                 *         0,
                 *         1,
                 *         0.5
                 *       ]
                 *     }
                 */
                "application/json": components["schemas"]["Table"];
                "application/octet-stream": Blob;
            };
        };
        responses: {
            /** @description The surface */
            200: {
                headers: {
                    "Server-Timing"?: string;
                    [name: string]: unknown;
                };
                content: {
                    "model/gltf-binary": Blob;
                    "model/obj": Blob;
                    "model/ply": Blob;
                };
            };
            /** @description A problem: damaged-content-encoding, body-incomplete, invalid-json or invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-mesh */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request or invalid-function */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    transportVectors: {
        parameters: {
            query?: {
                /** @description How the numbers of a raw answer are written; JSON has them in single precision. */
                encoding?: "f32" | "f16" | "octahedral";
                /**
                 * @description What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
                 *     naming such a vertex means the nearest.
                 */
                extend?: "none" | "nearest";
                /** @description How the numbers of a face are written. */
                form?: "world" | "frames" | "roots" | "axes";
                /**
                 * @description How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
                 *     mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
                 *     dropped ones are ignored, and answered as null.
                 */
                numbering?: "file" | "kept";
            };
            header?: never;
            path: {
                /**
                 * @description The id of the mesh
                 * @example 0f6d2c4ab1e84cf29be2e3f0b5d1a7c3
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["TransportRequest"];
            };
        };
        responses: {
            /** @description The vectors: a row for each face */
            200: {
                headers: {
                    "Chladni-Columns"?: number;
                    "Chladni-Dtype"?: string;
                    "Chladni-Rows"?: number;
                    "Server-Timing"?: string;
                    [name: string]: unknown;
                };
                content: {
                    /**
                     * @example {
                     *       "columns": 3,
                     *       "values": [
                     *         0,
                     *         0.1,
                     *         0.99
                     *       ]
                     *     }
                     */
                    "application/json": components["schemas"]["Table"];
                    "application/octet-stream": Blob;
                };
            };
            /** @description A problem: damaged-content-encoding, body-incomplete, invalid-json or invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-mesh */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request, no-field-surface or invalid-design */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getVertexMap: {
        parameters: {
            query?: {
                /** @description Takes the place of `Accept`. */
                format?: "json" | "npy";
                /** @description What there is an entry for: each vertex or face of the file, or each of the mesh. */
                of?: "file" | "kept";
            };
            header?: never;
            path: {
                /**
                 * @description The id of the mesh
                 * @example 0f6d2c4ab1e84cf29be2e3f0b5d1a7c3
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The map */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["MapAnswer"];
                    "application/x-npy": Blob;
                };
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-mesh */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    listProblems: {
        parameters: {
            query?: {
                /** @description `next` of the page before. */
                from?: string;
                /** @description Items of the page, at most 200. */
                limit?: number;
                /**
                 * @description Only problems whose name contains this, in capital letters or small ones.
                 * @example bracket
                 */
                name?: string;
            };
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description A page of problems */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["PageOf_ProblemResource"];
                };
            };
            /** @description A problem: invalid-query or invalid-cursor */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            500: components["responses"]["InternalError"];
        };
    };
    uploadProblem: {
        parameters: {
            query?: {
                /**
                 * @description A name for people, at most 200 characters.
                 * @example bracket, 2 mm
                 */
                name?: string;
            };
            header?: never;
            path?: never;
            cookie?: never;
        };
        /** @description The matrices */
        requestBody: {
            content: {
                "application/octet-stream": Blob;
                "application/x-matrix-market": Blob;
                "application/x-npz": Blob;
                "multipart/form-data": components["schemas"]["ProblemParts"];
            };
        };
        responses: {
            /** @description Equal matrices were stored before */
            200: {
                headers: {
                    Location?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["ProblemResource"];
                };
            };
            /** @description The problem is stored; `Location` names it */
            201: {
                headers: {
                    ETag?: string;
                    Location?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["ProblemResource"];
                };
            };
            /** @description A problem: damaged-content-encoding, body-incomplete, invalid-query or invalid-multipart */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unreadable-matrix or invalid-pencil */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy, storage-busy, storage-unavailable or draining */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: storage-full */
            507: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    showProblem: {
        parameters: {
            query?: never;
            header?: never;
            path: {
                /**
                 * @description The id of the problem
                 * @example 7be0a1d25c9f4e3388d1c6f2904ab57e
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The problem */
            200: {
                headers: {
                    ETag?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["ProblemResource"];
                };
            };
            /** @description The problem is as `If-None-Match` names it */
            304: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-problem */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
        };
    };
    deleteProblem: {
        parameters: {
            query?: {
                /** @description Cancels its unfinished jobs and deletes its bases too. */
                cascade?: boolean;
            };
            header?: {
                /**
                 * @description Only where this is the `ETag` of the present state
                 * @example W/"0f6d2c4ab1e84cf2"
                 */
                "If-Match"?: string | null;
            };
            path: {
                /**
                 * @description The id of the problem
                 * @example 7be0a1d25c9f4e3388d1c6f2904ab57e
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The problem is gone */
            204: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-problem */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: problem-in-use */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: precondition-failed */
            412: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: storage-busy or storage-unavailable */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: storage-full */
            507: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    renameProblem: {
        parameters: {
            query?: never;
            header?: {
                /**
                 * @description Only where this is the `ETag` of the present state
                 * @example W/"0f6d2c4ab1e84cf2"
                 */
                "If-Match"?: string | null;
            };
            path: {
                /**
                 * @description The id of the problem
                 * @example 7be0a1d25c9f4e3388d1c6f2904ab57e
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["RenameRequest"];
            };
        };
        responses: {
            /** @description The problem under its new name */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["ProblemResource"];
                };
            };
            /** @description A problem: damaged-content-encoding, body-incomplete, invalid-json or invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-problem */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: precondition-failed */
            412: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy, storage-busy or storage-unavailable */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: storage-full */
            507: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getProblemContent: {
        parameters: {
            query?: never;
            header?: {
                /**
                 * @description One range of bytes
                 * @example bytes=0-1023
                 */
                Range?: string | null;
            };
            path: {
                /**
                 * @description The id of the problem
                 * @example 7be0a1d25c9f4e3388d1c6f2904ab57e
                 */
                id: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The whole content */
            200: {
                headers: {
                    ETag?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/octet-stream": Blob;
                    "application/x-npz": Blob;
                    "application/zip": Blob;
                };
            };
            /** @description The bytes that `Range` asks for */
            206: {
                headers: {
                    "Content-Range"?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/octet-stream": Blob;
                    "application/x-npz": Blob;
                    "application/zip": Blob;
                };
            };
            /** @description The content is as `If-None-Match` names it */
            304: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-problem */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: range-not-satisfiable */
            416: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
        };
    };
    listSamples: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The samples */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["Samples"];
                };
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            500: components["responses"]["InternalError"];
        };
    };
    getSample: {
        parameters: {
            query?: {
                /** @description The format of the file. */
                format?: "ply" | "obj";
                /** @description About how many vertices: the mesh has the nearest number that the pattern of the shape allows. */
                vertices?: number;
            };
            header?: never;
            path: {
                /**
                 * @description A name from the list, or `genus-G` for a whole number G up to 50
                 * @example bell
                 */
                shape: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The mesh */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "model/obj": Blob;
                    "model/ply": Blob;
                };
            };
            /** @description A problem: invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-sample */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    compareShapes: {
        parameters: {
            query?: {
                /** @description The type of the numbers of a raw answer. */
                dtype?: "f32" | "f64";
            };
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["ComparisonRequest"];
            };
        };
        responses: {
            /** @description The comparison */
            200: {
                headers: {
                    "Chladni-Columns"?: number;
                    "Chladni-Dtype"?: string;
                    "Chladni-Rows"?: number;
                    "Server-Timing"?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["ComparisonAnswer"];
                    "application/octet-stream": Blob;
                    "image/svg+xml": Blob;
                };
            };
            /** @description A problem: damaged-content-encoding, body-incomplete, invalid-json or invalid-query */
            400: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            401: components["responses"]["Unauthenticated"];
            403: components["responses"]["Forbidden"];
            /** @description A problem: unknown-basis */
            404: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: not-acceptable */
            406: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-slow */
            408: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: basis-kind or incomparable-bases */
            409: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: body-too-large */
            413: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: unsupported-content-encoding or unsupported-media-type */
            415: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            /** @description A problem: invalid-request or invalid-analysis */
            422: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
            500: components["responses"]["InternalError"];
            /** @description A problem: busy */
            503: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
}
