#include "stereo/normals_simd.h"

#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "stereo/normals_simd.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace scanner::stereo::simd {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using DF = hn::ScalableTag<float>;
using VF = hn::Vec<DF>;
using DD = hn::ScalableTag<double>;
using VD = hn::Vec<DD>;
using DH = hn::Rebind<float, DD>;  ///< as many floats as there are doubles
using VH = hn::Vec<DH>;

constexpr std::size_t kTile = 128;
constexpr std::size_t kColumns = 192;  ///< kTile + 2 kMaxNormalRadius and a vector more
constexpr float kHuge = std::numeric_limits<float>::max();
/// The second eigenvalue against the largest: below, the points are on a line.
constexpr float kMinSpread = 1e-4f;

/// Sums over the rows of the window, and the depths' bounds over each square round its middle.
struct Columns {
  // The products of two floats are exact in double, and the sums lose nothing that matters: a
  // window's scatter is at least 1e-7 of its squared distance from the camera, double has 1e-16.
  // So the camera can be the origin, and all windows share the sums of their columns.
  HWY_ALIGN double sums[9][kColumns];  ///< x y z xx xy xz yy yz zz
  HWY_ALIGN float count[kColumns];
  HWY_ALIGN float low[kMaxNormalRadius][kColumns];
  HWY_ALIGN float high[kMaxNormalRadius][kColumns];
};

struct Scatter {
  HWY_ALIGN float xx[kTile], xy[kTile], xz[kTile], yy[kTile], yz[kTile], zz[kTile], count[kTile];
};

struct ColumnSum {
  VD x, y, z, xx, xy, xz, yy, yz, zz;
  VH count, low, high;
};

HWY_INLINE void addPoint(const PointPlanes& row, std::ptrdiff_t u, ColumnSum& s) {
  const DD d;
  const DH h;
  const VH valid = hn::LoadU(h, row.valid + u);
  const VH depth = hn::LoadU(h, row.z + u);
  const VD x = hn::PromoteTo(d, hn::LoadU(h, row.x + u));
  const VD y = hn::PromoteTo(d, hn::LoadU(h, row.y + u));
  const VD z = hn::PromoteTo(d, depth);
  s.x = hn::Add(s.x, x);
  s.y = hn::Add(s.y, y);
  s.z = hn::Add(s.z, z);
  s.xx = hn::Add(s.xx, hn::Mul(x, x));
  s.xy = hn::Add(s.xy, hn::Mul(x, y));
  s.xz = hn::Add(s.xz, hn::Mul(x, z));
  s.yy = hn::Add(s.yy, hn::Mul(y, y));
  s.yz = hn::Add(s.yz, hn::Mul(y, z));
  s.zz = hn::Add(s.zz, hn::Mul(z, z));
  s.count = hn::Add(s.count, valid);
  const auto known = hn::Gt(valid, hn::Zero(h));
  s.low = hn::Min(s.low, hn::IfThenElse(known, depth, hn::Set(h, kHuge)));
  s.high = hn::Max(s.high, hn::IfThenElse(known, depth, hn::Set(h, -kHuge)));
}

/// kRadius 0: the radius is known only at run time.
template <int kRadius>
HWY_INLINE void sumColumns(const NormalRow& row, std::ptrdiff_t first, std::size_t count,
                           Columns& columns) {
  const int radius = kRadius > 0 ? kRadius : row.radius;
  const DD d;
  const DH h;
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    const std::ptrdiff_t u = first + static_cast<std::ptrdiff_t>(i);
    const VD zero = hn::Zero(d);
    ColumnSum s{zero,
                zero,
                zero,
                zero,
                zero,
                zero,
                zero,
                zero,
                zero,
                hn::Zero(h),
                hn::Set(h, kHuge),
                hn::Set(h, -kHuge)};
    addPoint(row.rows[radius], u, s);
    for (int k = 1; k <= radius; ++k) {
      addPoint(row.rows[radius - k], u, s);
      addPoint(row.rows[radius + k], u, s);
      hn::Store(s.low, h, columns.low[k - 1] + i);
      hn::Store(s.high, h, columns.high[k - 1] + i);
    }
    hn::Store(s.x, d, columns.sums[0] + i);
    hn::Store(s.y, d, columns.sums[1] + i);
    hn::Store(s.z, d, columns.sums[2] + i);
    hn::Store(s.xx, d, columns.sums[3] + i);
    hn::Store(s.xy, d, columns.sums[4] + i);
    hn::Store(s.xz, d, columns.sums[5] + i);
    hn::Store(s.yy, d, columns.sums[6] + i);
    hn::Store(s.yz, d, columns.sums[7] + i);
    hn::Store(s.zz, d, columns.sums[8] + i);
    hn::Store(s.count, h, columns.count + i);
  }
}

template <int kRadius>
HWY_INLINE VD windowSum(const double* sums, int radius) {
  const DD d;
  const int size = 2 * (kRadius > 0 ? kRadius : radius) + 1;
  VD sum = hn::LoadU(d, sums);
  for (int j = 1; j < size; ++j) sum = hn::Add(sum, hn::LoadU(d, sums + j));
  return sum;
}

template <int kRadius>
HWY_INLINE void scatterAboutMean(const Columns& columns, std::size_t count, int radius,
                                 Scatter& scatter) {
  const DD d;
  const DH h;
  const int size = 2 * (kRadius > 0 ? kRadius : radius) + 1;
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    VH n = hn::LoadU(h, columns.count + i);
    for (int j = 1; j < size; ++j) n = hn::Add(n, hn::LoadU(h, columns.count + i + j));
    hn::Store(n, h, scatter.count + i);
    // Never 0 / 0; an empty window has too few points anyway.
    const VD share = hn::Div(hn::Set(d, 1.0), hn::PromoteTo(d, hn::Max(n, hn::Set(h, 1.0f))));
    const VD x = windowSum<kRadius>(columns.sums[0] + i, radius);
    const VD y = windowSum<kRadius>(columns.sums[1] + i, radius);
    const VD z = windowSum<kRadius>(columns.sums[2] + i, radius);
    const VD mx = hn::Mul(x, share), my = hn::Mul(y, share), mz = hn::Mul(z, share);
    const auto store = [&](int sum, VD product, float* to) HWY_ATTR {
      const VD moment = windowSum<kRadius>(columns.sums[sum] + i, radius);
      hn::Store(hn::DemoteTo(h, hn::Sub(moment, product)), h, to + i);
    };
    store(3, hn::Mul(x, mx), scatter.xx);
    store(4, hn::Mul(x, my), scatter.xy);
    store(5, hn::Mul(x, mz), scatter.xz);
    store(6, hn::Mul(y, my), scatter.yy);
    store(7, hn::Mul(y, mz), scatter.yz);
    store(8, hn::Mul(z, mz), scatter.zz);
  }
}

struct Normal {
  VF x, y, z;
  hn::Mask<DF> defined;
};

/// Smallest eigenvalue of the symmetric matrix of trace 1. Trigonometric solution of the cubic: the
/// eigenvalue is 1/3 - 2 p cos(acos(s) / 3), and cos(acos(s) / 3) = cos(2/3 acos(c)) with
/// c = cos(acos(s) / 2) = sqrt((1 + s) / 2) is smooth in c: the polynomial is within 3e-8.
HWY_INLINE VF smallestEigenvalue(VF xx, VF xy, VF xz, VF yy, VF yz, VF zz) {
  const DF d;
  const VF third = hn::Set(d, 1.0f / 3.0f), half = hn::Set(d, 0.5f), one = hn::Set(d, 1.0f);
  const VF a = hn::Sub(xx, third), b = hn::Sub(yy, third), c = hn::Sub(zz, third);
  const VF outer = hn::Add(hn::Add(hn::Mul(xy, xy), hn::Mul(xz, xz)), hn::Mul(yz, yz));
  const VF inner = hn::Add(hn::Add(hn::Mul(a, a), hn::Mul(b, b)), hn::Mul(c, c));
  const VF square = hn::Mul(hn::Add(inner, hn::Add(outer, outer)), hn::Set(d, 1.0f / 6.0f));
  const VF p = hn::Sqrt(square);
  const VF det = hn::Add(hn::Sub(hn::Mul(a, hn::Sub(hn::Mul(b, c), hn::Mul(yz, yz))),
                                 hn::Mul(xy, hn::Sub(hn::Mul(xy, c), hn::Mul(yz, xz)))),
                         hn::Mul(xz, hn::Sub(hn::Mul(xy, yz), hn::Mul(b, xz))));
  // A sphere of points has p = 0; the bound keeps the quotient finite.
  const VF cube = hn::Max(hn::Mul(square, p), hn::Set(d, 1e-30f));
  const VF ratio = hn::Div(hn::Mul(det, half), cube);  // cosine of three times the angle, minus
  const VF s = hn::Max(hn::Min(ratio, one), hn::Neg(one));
  const VF x = hn::Sqrt(hn::Mul(hn::Sub(one, s), half));
  constexpr float kCosine[] = {0.500000026f,   0.577346917f,  -0.111038511f,   0.0528414091f,
                               -0.0302353976f, 0.0160472804f, -0.00608934568f, 0.00112763624f};
  VF h = hn::Set(d, kCosine[7]);
  for (int i = 6; i >= 0; --i) h = hn::Add(hn::Mul(h, x), hn::Set(d, kCosine[i]));
  return hn::Sub(third, hn::Mul(hn::Add(p, p), h));
}

/// Eigenvector of the smallest eigenvalue: a column of the adjugate of A - lambda, which is
/// (l2 - l)(l3 - l) v v^T, times the adjugate once more (a step of inverse iteration), so that the
/// error of lambda counts squared against the distance to the next eigenvalue.
HWY_INLINE Normal smallestEigenvector(const Scatter& scatter, std::size_t i) {
  const DF d;
  VF xx = hn::Load(d, scatter.xx + i), xy = hn::Load(d, scatter.xy + i);
  VF xz = hn::Load(d, scatter.xz + i), yy = hn::Load(d, scatter.yy + i);
  VF yz = hn::Load(d, scatter.yz + i), zz = hn::Load(d, scatter.zz + i);
  const VF trace = hn::Add(hn::Add(xx, yy), zz);
  Normal out;
  out.defined = hn::Gt(trace, hn::Zero(d));
  const VF scale = hn::Div(hn::Set(d, 1.0f), hn::IfThenElse(out.defined, trace, hn::Set(d, 1.0f)));
  xx = hn::Mul(xx, scale), xy = hn::Mul(xy, scale), xz = hn::Mul(xz, scale);
  yy = hn::Mul(yy, scale), yz = hn::Mul(yz, scale), zz = hn::Mul(zz, scale);
  const VF smallest = smallestEigenvalue(xx, xy, xz, yy, yz, zz);

  // The others' sum and product: l2 > k l3 is product > k / (1 + k)^2 sum^2.
  const VF minors = hn::Sub(hn::Add(hn::Add(hn::Mul(xx, yy), hn::Mul(xx, zz)), hn::Mul(yy, zz)),
                            hn::Add(hn::Add(hn::Mul(xy, xy), hn::Mul(xz, xz)), hn::Mul(yz, yz)));
  const VF sum = hn::Sub(hn::Set(d, 1.0f), smallest);
  const VF product = hn::Sub(minors, hn::Mul(smallest, sum));
  constexpr float kShare = kMinSpread / ((1.0f + kMinSpread) * (1.0f + kMinSpread));
  out.defined =
      hn::And(out.defined, hn::Gt(product, hn::Mul(hn::Set(d, kShare), hn::Mul(sum, sum))));

  const VF a = hn::Sub(xx, smallest), b = hn::Sub(yy, smallest), c = hn::Sub(zz, smallest);
  const VF mxx = hn::Sub(hn::Mul(b, c), hn::Mul(yz, yz));
  const VF mxy = hn::Sub(hn::Mul(xz, yz), hn::Mul(xy, c));
  const VF mxz = hn::Sub(hn::Mul(xy, yz), hn::Mul(xz, b));
  const VF myy = hn::Sub(hn::Mul(a, c), hn::Mul(xz, xz));
  const VF myz = hn::Sub(hn::Mul(xy, xz), hn::Mul(yz, a));
  const VF mzz = hn::Sub(hn::Mul(a, b), hn::Mul(xy, xy));
  const auto y_first = hn::Gt(myy, mxx);
  VF x = hn::IfThenElse(y_first, mxy, mxx);
  VF y = hn::IfThenElse(y_first, myy, mxy);
  VF z = hn::IfThenElse(y_first, myz, mxz);
  const auto z_first = hn::Gt(mzz, hn::IfThenElse(y_first, myy, mxx));
  x = hn::IfThenElse(z_first, mxz, x);
  y = hn::IfThenElse(z_first, myz, y);
  z = hn::IfThenElse(z_first, mzz, z);
  const auto row = [&](VF r, VF s, VF t) HWY_ATTR {
    return hn::Add(hn::Add(hn::Mul(r, x), hn::Mul(s, y)), hn::Mul(t, z));
  };
  out.x = row(mxx, mxy, mxz);
  out.y = row(mxy, myy, myz);
  out.z = row(mxz, myz, mzz);
  return out;
}

/// No neighbour is further in depth than its distance in pixels allows. What a square allows its
/// border, it allows all it holds, so bounds over the squares decide as a test of each would.
template <int kRadius>
HWY_INLINE hn::Mask<DF> withoutStep(const NormalRow& row, const Columns& columns, std::size_t i,
                                    VF z, VF sigma) {
  const DF d;
  const int radius = kRadius > 0 ? kRadius : row.radius;
  const VF tolerance = hn::Mul(sigma, hn::Set(d, row.max_step_sigmas));
  const VF per_pixel = hn::Mul(z, hn::Set(d, row.max_step_ratio));
  auto flat = hn::Eq(z, z);
  for (int k = 1; k <= radius; ++k) {
    const float* low = columns.low[k - 1] + i + static_cast<std::size_t>(radius - k);
    const float* high = columns.high[k - 1] + i + static_cast<std::size_t>(radius - k);
    VF least = hn::LoadU(d, low), most = hn::LoadU(d, high);
    for (int j = 1; j <= 2 * k; ++j) {
      least = hn::Min(least, hn::LoadU(d, low + j));
      most = hn::Max(most, hn::LoadU(d, high + j));
    }
    const VF limit = hn::Add(hn::Mul(per_pixel, hn::Set(d, static_cast<float>(k))), tolerance);
    flat =
        hn::And(flat, hn::And(hn::Le(hn::Sub(z, least), limit), hn::Le(hn::Sub(most, z), limit)));
  }
  return flat;
}

template <int kRadius>
HWY_INLINE void solve(const NormalRow& row, const Columns& columns, const Scatter& scatter,
                      std::size_t first, std::size_t count) {
  const DF d;
  const std::size_t lanes = hn::Lanes(d);
  const PointPlanes& own = row.rows[kRadius > 0 ? kRadius : row.radius];
  HWY_ALIGN float part[3 * HWY_MAX_BYTES / sizeof(float)];
  for (std::size_t i = 0; i < count; i += lanes) {
    const std::size_t u = first + i;
    const std::size_t here = count - i < lanes ? count - i : lanes;
    const VF px = hn::LoadU(d, own.x + u), py = hn::LoadU(d, own.y + u);
    const VF pz = hn::LoadU(d, own.z + u);
    VF sigma = hn::Zero(d);
    if (row.sigma != nullptr && here == lanes) sigma = hn::LoadU(d, row.sigma + u);
    if (row.sigma != nullptr && here < lanes) {
      for (std::size_t j = 0; j < lanes; ++j) part[j] = j < here ? row.sigma[u + j] : 0.0f;
      sigma = hn::Load(d, part);
    }
    Normal n = smallestEigenvector(scatter, i);
    const VF dot = hn::Add(hn::Add(hn::Mul(n.x, px), hn::Mul(n.y, py)), hn::Mul(n.z, pz));
    const VF square = hn::Add(hn::Add(hn::Mul(n.x, n.x), hn::Mul(n.y, n.y)), hn::Mul(n.z, n.z));
    n.defined = hn::And(n.defined, hn::Gt(square, hn::Zero(d)));
    n.defined = hn::And(n.defined, hn::Gt(hn::LoadU(d, own.valid + u), hn::Zero(d)));
    n.defined =
        hn::And(n.defined, hn::Ge(hn::Load(d, scatter.count + i), hn::Set(d, row.min_points)));
    n.defined = hn::And(n.defined, withoutStep<kRadius>(row, columns, i, pz, sigma));
    const VF length = hn::Sqrt(square);
    const VF signed_length = hn::IfThenElse(hn::Gt(dot, hn::Zero(d)), hn::Neg(length), length);
    const VF scale =
        hn::Div(hn::Set(d, 1.0f), hn::IfThenElse(n.defined, signed_length, hn::Set(d, 1.0f)));
    const VF nan = hn::Set(d, std::numeric_limits<float>::quiet_NaN());
    const VF x = hn::IfThenElse(n.defined, hn::Mul(n.x, scale), nan);
    const VF y = hn::IfThenElse(n.defined, hn::Mul(n.y, scale), nan);
    const VF z = hn::IfThenElse(n.defined, hn::Mul(n.z, scale), nan);
    if (here == lanes) {
      hn::StoreInterleaved3(x, y, z, d, row.normals + 3 * u);
      continue;
    }
    hn::StoreInterleaved3(x, y, z, d, part);
    for (std::size_t j = 0; j < 3 * here; ++j) row.normals[3 * u + j] = part[j];
  }
}

template <int kRadius>
HWY_INLINE void normalRowOf(const NormalRow& row, std::size_t width) {
  Columns columns;
  Scatter scatter;
  const auto radius = static_cast<std::size_t>(kRadius > 0 ? kRadius : row.radius);
  for (std::size_t first = 0; first < width; first += kTile) {
    const std::size_t count = width - first < kTile ? width - first : kTile;
    const std::size_t lanes = hn::Lanes(DF());
    const std::size_t whole = (count + lanes - 1) / lanes * lanes;
    sumColumns<kRadius>(row,
                        static_cast<std::ptrdiff_t>(first) - static_cast<std::ptrdiff_t>(radius),
                        whole + 2 * radius, columns);
    scatterAboutMean<kRadius>(columns, whole, row.radius, scatter);
    solve<kRadius>(row, columns, scatter, first, count);
  }
}

void normalRow(const NormalRow& row, std::size_t width) {
  if (row.radius == 2) return normalRowOf<2>(row, width);
  normalRowOf<0>(row, width);
}

void splitPoints(const float* points, std::size_t width, const PointPlanes& planes) {
  const DF d;
  const std::size_t lanes = hn::Lanes(d);
  std::size_t u = 0;
  for (; u + lanes <= width; u += lanes) {
    VF x, y, z;
    hn::LoadInterleaved3(d, points + 3 * u, x, y, z);
    const auto known = hn::Eq(z, z);
    hn::StoreU(hn::IfThenElseZero(known, x), d, planes.x + u);
    hn::StoreU(hn::IfThenElseZero(known, y), d, planes.y + u);
    hn::StoreU(hn::IfThenElseZero(known, z), d, planes.z + u);
    hn::StoreU(hn::IfThenElseZero(known, hn::Set(d, 1.0f)), d, planes.valid + u);
  }
  for (; u < width; ++u) {
    const float* p = points + 3 * u;
    const bool known = p[2] == p[2];
    planes.x[u] = known ? p[0] : 0.0f;
    planes.y[u] = known ? p[1] : 0.0f;
    planes.z[u] = known ? p[2] : 0.0f;
    planes.valid[u] = known ? 1.0f : 0.0f;
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace scanner::stereo::simd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace scanner::stereo::simd {

HWY_EXPORT(splitPoints);
HWY_EXPORT(normalRow);

void splitPoints(const float* points, std::size_t width, const PointPlanes& planes) {
  HWY_DYNAMIC_DISPATCH(splitPoints)(points, width, planes);
}

void normalRow(const NormalRow& row, std::size_t width) {
  HWY_DYNAMIC_DISPATCH(normalRow)(row, width);
}

}  // namespace scanner::stereo::simd
#endif
