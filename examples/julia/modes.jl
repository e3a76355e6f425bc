# The eigenfunctions of a mesh in Julia, by the HTTP API of a running server (chladni serve).
#
#   julia -e 'import Pkg; Pkg.add(["HTTP", "JSON", "NPZ"])'    once
#   julia modes.jl [http://127.0.0.1:8080]
using HTTP, JSON, LinearAlgebra, NPZ

url = isempty(ARGS) ? "http://127.0.0.1:8080" : ARGS[1]
call(method, path, body = "", type = "application/json") =
    HTTP.request(method, url * path, ["Content-Type" => type], body).body
json(method, path, body...) = JSON.parse(String(call(method, path, body...)))

ply = call("GET", "/v1/samples/starfish?vertices=3000")
mesh = json("POST", "/v1/meshes?name=starfish", ply, "model/ply")["id"]
wanted = Dict("method" => "hsim", "count" => 60, "tolerance" => 1e-8, "precision" => "f64")
job = json("POST", "/v1/jobs", JSON.json(Dict("kind" => "eigenbasis", "mesh" => mesh, "parameters" => wanted)))
basis = json("GET", "/v1/jobs/$(job["id"])?wait=60s")["basis"]
write("starfish.npz", call("GET", "/v1/bases/$basis/content"))

file = npzread("starfish.npz", ["functions", "eigenvalues", "mass"])
Φ, λ, M = file["functions"], file["eigenvalues"], Diagonal(file["mass"])
println(size(Φ), ", defect ", norm(Φ' * M * Φ - I))

# Heat kernel signatures at eight times: a row for each vertex.
times = exp.(range(log(4log(10) / λ[end]), log(4log(10) / λ[2]), 8))
hks = Φ .^ 2 * exp.(-λ * times')
println("hottest at vertex ", argmax(hks[:, 4]))
