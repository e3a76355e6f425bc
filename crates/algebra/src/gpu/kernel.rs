//! The kernels: WGSL texts with the precision and the sizes of tiles filled in, and their pipelines.

use super::real::{Real, Tile};

/// Bytes of immediate parameters that every kernel takes: its struct fits in them.
pub(super) const IMMEDIATE_BYTES: u32 = 64;

/// Threads of a group in kernels over the entries of a vector.
pub(super) const VECTOR_THREADS: u32 = 256;

/// Threads of a group in the product of a matrix and a vector.
const ROW_THREADS: u32 = 128;

/// Rows that a group computes in the product of a matrix and a vector.
pub(super) const ROWS_AT_ONCE: u32 = 4;

/// The edge of a tile of a transposition.
pub(super) const TRANSPOSE_EDGE: u32 = 16;

/// All kernels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum KernelName {
    /// `C ← αAB + βC`.
    Product,
    /// `C ← αAᵀB + βC`.
    TransposedProduct,
    /// `C ← αABᵀ + βC`.
    ProductTransposed,
    /// `C ← Aᵀ`.
    Transpose,
    /// The sum of several matrices that lie behind each other.
    Fold,
    /// A column of the matrix that is being tridiagonalised.
    Column,
    /// Its reflector, and the matrix times that.
    Reflect,
    /// The second vector of the rank-two update.
    Combine,
    /// A sparse matrix times a dense one.
    Sparse,
    /// A pass of a multigrid cycle over a panel.
    Smooth,
    /// The residuals of pairs, and their sums.
    Residuals,
    /// What is left of residuals, and the sums that enclose their norms.
    Enclosure,
    /// How trees are eliminated.
    Pivots,
    /// What is left of residuals, through trees.
    Trees,
    /// Where energy sits.
    Density,
}

/// What a pass of [`KernelName::Smooth`] does, `D` the absolute row sums of `A`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Pass {
    /// `out ← γ D⁻¹ b`.
    Scale,
    /// `out ← b − A x`.
    Rest,
    /// `out ← (1 + β) x + γ D⁻¹ (b − A x)`.
    Fresh,
    /// The same less `β out`.
    Step,
    /// `out ← out + x`.
    Add,
}

impl Pass {
    const ALL: [Self; 5] = [Self::Scale, Self::Rest, Self::Fresh, Self::Step, Self::Add];

    fn name(self) -> &'static str {
        match self {
            Self::Scale => "SCALE",
            Self::Rest => "REST",
            Self::Fresh => "FRESH",
            Self::Step => "STEP",
            Self::Add => "ADD",
        }
    }
}

impl KernelName {
    /// Its name in messages.
    pub(super) fn text(self) -> &'static str {
        match self {
            Self::Product => "product",
            Self::TransposedProduct => "transposed-product",
            Self::ProductTransposed => "product-transposed",
            Self::Transpose => "transpose",
            Self::Fold => "fold",
            Self::Column => "column",
            Self::Reflect => "reflect",
            Self::Combine => "combine",
            Self::Sparse => "sparse",
            Self::Smooth => "smooth",
            Self::Residuals => "residuals",
            Self::Enclosure => "enclosure",
            Self::Pivots => "pivots",
            Self::Trees => "trees",
            Self::Density => "density",
        }
    }

    /// The bindings in order: whether each is only read.
    fn bindings(self) -> &'static [bool] {
        match self {
            Self::Product | Self::TransposedProduct | Self::ProductTransposed => &[true, true, false],
            Self::Transpose | Self::Fold => &[true, false],
            Self::Column | Self::Reflect | Self::Combine => &[true, false, false],
            Self::Sparse => &[true, true, true, true, false],
            Self::Smooth => &[true, true, true, true, true, true, true, false],
            Self::Residuals => &[true, true, true, true, true, true, true, false, true, true, false],
            Self::Enclosure => &[true, true, true, true, true, true, true, false, true, true, true, false, false],
            Self::Pivots => &[true, true, true, true, true, false, false],
            Self::Trees => &[true, true, true, true, false, false],
            Self::Density => &[true, true, true, false],
        }
    }

    fn source<T: Real>(self) -> String {
        let text = match self {
            Self::Product => product::<T>(false, false),
            Self::TransposedProduct => product::<T>(true, false),
            Self::ProductTransposed => product::<T>(false, true),
            Self::Transpose => include_str!("transpose.wgsl").replace("{EDGE}", &TRANSPOSE_EDGE.to_string()),
            Self::Fold => include_str!("fold.wgsl").to_owned(),
            Self::Column | Self::Reflect | Self::Combine => include_str!("householder.wgsl")
                .replace("{TINY}", T::TINY.1)
                .replace("{ROW_THREADS}", &ROW_THREADS.to_string()),
            Self::Sparse => include_str!("sparse.wgsl").to_owned(),
            Self::Smooth => Pass::ALL.iter().fold(include_str!("smooth.wgsl").to_owned(), |text, pass| {
                text.replace(&format!("{{{}}}", pass.name()), &(*pass as u32).to_string())
            }),
            Self::Residuals => include_str!("residuals.wgsl").replace("{SUMS}", include_str!("sums.wgsl")),
            Self::Enclosure => include_str!("enclosure.wgsl").replace("{SUMS}", include_str!("sums.wgsl")),
            Self::Pivots => include_str!("pivots.wgsl").to_owned(),
            Self::Trees => include_str!("trees.wgsl").to_owned(),
            Self::Density => include_str!("density.wgsl").to_owned(),
        };
        text.replace("{T}", T::NAME).replace("{THREADS}", &VECTOR_THREADS.to_string())
    }

    fn entry(self) -> &'static str {
        match self {
            Self::Column => "column",
            Self::Reflect => "reflector",
            Self::Combine => "combine",
            _ => "main",
        }
    }
}

/// The text of the product. What a thread computes is written out, since arrays with variable places would not stay in
/// registers, and checks of bounds inside the innermost loop would cost more than the arithmetic.
fn product<T: Real>(transpose_a: bool, transpose_b: bool) -> String {
    let Tile { rows, columns, depth, own_rows, own_columns } = T::TILE;
    let across = columns / own_columns;
    let lines = |line: &dyn Fn(u32, u32) -> String| -> String {
        (0..own_rows).flat_map(|i| (0..own_columns).map(move |j| (i, j))).map(|(i, j)| line(i, j)).collect()
    };
    let declare = lines(&|i, j| format!("  var c_{i}_{j} = {{T}}(0);\n"));
    let mut multiply = String::new();
    for i in 0..own_rows {
        multiply += &format!("      let a_{i} = tile_a[k * {}u + down * {own_rows}u + {i}u];\n", rows + 1);
    }
    for j in 0..own_columns {
        multiply += &format!("      let b_{j} = tile_b[k * {}u + across + {}u];\n", columns + 1, j * across);
    }
    multiply += &lines(&|i, j| format!("      c_{i}_{j} += a_{i} * b_{j};\n"));
    let store = lines(&|i, j| {
        format!(
            "  put(wg.z, first_row + down * {own_rows}u + {i}u, first_column + across + {}u, c_{i}_{j});\n",
            j * across
        )
    });
    let place = |transposed, row: &str, column: &str| {
        if transposed { format!("({column}) * pitch + ({row})") } else { format!("({row}) * pitch + ({column})") }
    };
    // Neighbouring threads read neighbouring numbers, whichever way a matrix lies.
    let split = |transposed: bool, edge: u32| {
        if transposed {
            format!("let k = i / {edge}u; let r = i % {edge}u;")
        } else {
            format!("let r = i / {depth}u; let k = i % {depth}u;")
        }
    };
    include_str!("product.wgsl")
        .replace("{DECLARE}", &declare)
        .replace("{MULTIPLY}", &multiply)
        .replace("{STORE}", &store)
        .replace("{SPLIT_A}", &split(transpose_a, rows))
        .replace("{SPLIT_B}", &split(!transpose_b, columns))
        .replace("{PLACE_A}", &place(transpose_a, "first_row + r", "low + k").replace("pitch", "s.a_pitch"))
        .replace("{PLACE_B}", &place(transpose_b, "low + k", "first_column + r").replace("pitch", "s.b_pitch"))
        .replace("{PITCH_A}", &(rows + 1).to_string())
        .replace("{PITCH_B}", &(columns + 1).to_string())
        .replace("{SHARED_A}", &(depth * (rows + 1)).to_string())
        .replace("{SHARED_B}", &(depth * (columns + 1)).to_string())
        .replace("{ROWS}", &rows.to_string())
        .replace("{COLUMNS}", &columns.to_string())
        .replace("{DEPTH}", &depth.to_string())
        .replace("{ACROSS}", &across.to_string())
        .replace("{GROUP}", &(across * (rows / own_rows)).to_string())
}

/// A compiled kernel.
pub(super) struct Kernel {
    pub(super) pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
}

impl Kernel {
    /// Compiles a kernel. Errors come through the device's error scope.
    pub(super) fn new<T: Real>(device: &wgpu::Device, name: KernelName) -> Self {
        let source = wgpu::ShaderSource::Wgsl(name.source::<T>().into());
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(name.text()), source });
        let entries: Vec<wgpu::BindGroupLayoutEntry> = name
            .bindings()
            .iter()
            .zip(0..)
            .map(|(&read_only, binding)| wgpu::BindGroupLayoutEntry {
                binding,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: wgpu::BindingType::Buffer {
                    ty: wgpu::BufferBindingType::Storage { read_only },
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                count: None,
            })
            .collect();
        let layout =
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries });
        let whole = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &[Some(&layout)],
            immediate_size: IMMEDIATE_BYTES,
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(name.text()),
            layout: Some(&whole),
            module: &module,
            entry_point: Some(name.entry()),
            // Every kernel writes what it reads of the memory that its group shares.
            compilation_options: wgpu::PipelineCompilationOptions {
                zero_initialize_workgroup_memory: false,
                ..Default::default()
            },
            cache: None,
        });
        Self { pipeline, layout }
    }

    /// The buffers that it works on, in the order of its bindings.
    pub(super) fn bind(&self, device: &wgpu::Device, buffers: &[wgpu::BindingResource<'_>]) -> wgpu::BindGroup {
        let entries: Vec<wgpu::BindGroupEntry<'_>> = buffers
            .iter()
            .zip(0..)
            .map(|(resource, binding)| wgpu::BindGroupEntry { binding, resource: resource.clone() })
            .collect();
        device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout: &self.layout, entries: &entries })
    }
}
