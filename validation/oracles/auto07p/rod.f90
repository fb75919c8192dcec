! Equations (4.9) and boundary conditions (4.11) of the elastic rod for AUTO-07p.
!
! States: r (3), q (4), n (3), mu (4), s; with NDIM = 16 the energy as well.
! Parameters: 1 alpha, 2 energy and 3 m3(0) (printed), 4 K1, 5 K3.
! rod.dat: number of pieces and terms, breaks, Chebyshev coefficients of w1hat and w2hat.
! start.dat: rows of states at equal steps of s from 0 to 1; first alpha, K1, K3.
module rod_data
  implicit none
  integer :: n_pieces = 0, n_terms = 0, n_rows = 0
  double precision, allocatable :: breaks(:), series(:, :, :), start(:, :)
  double precision :: start_alpha, k1, k3
  double precision, parameter :: b(4, 4, 3) = reshape((/ &
       0d0, 0d0, 0d0, -1d0, 0d0, 0d0, -1d0, 0d0, 0d0, 1d0, 0d0, 0d0, 1d0, 0d0, 0d0, 0d0, &
       0d0, 0d0, 1d0, 0d0, 0d0, 0d0, 0d0, -1d0, -1d0, 0d0, 0d0, 0d0, 0d0, 1d0, 0d0, 0d0, &
       0d0, -1d0, 0d0, 0d0, 1d0, 0d0, 0d0, 0d0, 0d0, 0d0, 0d0, -1d0, 0d0, 0d0, 1d0, 0d0 /), &
       (/ 4, 4, 3 /))
contains
  subroutine load()
    integer :: i, j
    if (n_pieces > 0) return
    open (31, file='rod.dat', status='old')
    read (31, *) n_pieces, n_terms
    allocate (breaks(0:n_pieces), series(0:n_terms - 1, 2, n_pieces))
    read (31, *) breaks
    do i = 1, n_pieces
      do j = 1, 2
        read (31, *) series(:, j, i)
      end do
    end do
    close (31)
    open (31, file='start.dat', status='old')
    read (31, *) start_alpha, k1, k3
    read (31, *) n_rows
    allocate (start(15, 0:n_rows - 1))
    read (31, *) start
    close (31)
  end subroutine load

  subroutine strains(s, w, dw)
    double precision, intent(in) :: s
    double precision, intent(out) :: w(3), dw(3)
    integer :: low, high, middle, j, k
    double precision :: x, rate, b1, b2, old, c1, c2, old_c
    low = 1
    high = n_pieces
    do while (low < high)
      middle = (low + high) / 2
      if (s < breaks(middle)) then
        high = middle
      else
        low = middle + 1
      end if
    end do
    rate = 2d0 / (breaks(low) - breaks(low - 1))
    x = (s - breaks(low - 1)) * rate - 1d0
    do j = 1, 2
      b1 = 0d0
      b2 = 0d0
      c1 = 0d0
      c2 = 0d0
      do k = n_terms - 1, 1, -1
        old_c = c1
        c1 = 2d0 * x * c1 - c2 + 2d0 * b1
        c2 = old_c
        old = b1
        b1 = 2d0 * x * b1 - b2 + series(k, j, low)
        b2 = old
      end do
      w(j) = x * b1 - b2 + series(0, j, low)
      dw(j) = (b1 + x * c1 - c2) * rate
    end do
    w(3) = 0d0
    dw(3) = 0d0
  end subroutine strains
end module rod_data

subroutine func(ndim, u, icp, par, ijac, f, dfdu, dfdp)
  use rod_data
  implicit none
  integer, intent(in) :: ndim, icp(*), ijac
  double precision, intent(in) :: u(ndim), par(*)
  double precision, intent(out) :: f(ndim)
  double precision, intent(inout) :: dfdu(ndim, ndim), dfdp(ndim, *)
  double precision :: q(4), n(3), mu(4), w(3), dw(3), strain(3), m(3), c(3), turn(4, 4)
  double precision :: bq(4, 3), bm(4, 3), d(3, 4)
  integer :: i, j, k
  call load()
  q = u(4:7)
  n = u(8:10)
  mu = u(11:14)
  call strains(u(15), w, dw)
  c = (/ 1d0 / k1, 1d0 / k1, 1d0 / k3 /)
  turn = 0d0
  do j = 1, 3
    bq(:, j) = matmul(b(:, :, j), q)
    bm(:, j) = matmul(b(:, :, j), mu)
    m(j) = 0.5d0 * dot_product(mu, bq(:, j))
    strain(j) = m(j) * c(j) + w(j)
    turn = turn + 0.5d0 * strain(j) * b(:, :, j)
  end do
  d(1, :) = 2d0 * (/ q(3), q(4), q(1), q(2) /)
  d(2, :) = 2d0 * (/ -q(4), q(3), q(2), -q(1) /)
  d(3, :) = 2d0 * (/ -q(1), -q(2), q(3), q(4) /)
  f(1:3) = 0.5d0 * matmul(d, q)
  f(4:7) = matmul(turn, q)
  f(8:10) = 0d0
  f(11:14) = matmul(turn, mu) - matmul(transpose(d), n)
  f(15) = 1d0
  if (ndim > 15) f(16) = 0.5d0 * sum(m * m * c)
  if (ijac == 0) return
  dfdu = 0d0
  dfdu(1:3, 4:7) = d
  dfdu(4:7, 4:7) = turn
  dfdu(11:14, 11:14) = turn
  dfdu(11:14, 8:10) = -transpose(d)
  do j = 1, 3
    do k = 1, 4
      do i = 1, 4
        ! d m_j / d q = -B_j mu / 2 (B_j is skew), d m_j / d mu = B_j q / 2
        dfdu(3 + i, 3 + k) = dfdu(3 + i, 3 + k) - 0.25d0 * c(j) * bq(i, j) * bm(k, j)
        dfdu(3 + i, 10 + k) = dfdu(3 + i, 10 + k) + 0.25d0 * c(j) * bq(i, j) * bq(k, j)
        dfdu(10 + i, 3 + k) = dfdu(10 + i, 3 + k) - 0.25d0 * c(j) * bm(i, j) * bm(k, j)
        dfdu(10 + i, 10 + k) = dfdu(10 + i, 10 + k) + 0.25d0 * c(j) * bm(i, j) * bq(k, j)
      end do
    end do
    dfdu(4:7, 15) = dfdu(4:7, 15) + 0.5d0 * dw(j) * bq(:, j)
    dfdu(11:14, 15) = dfdu(11:14, 15) + 0.5d0 * dw(j) * bm(:, j)
    if (ndim > 15) then
      dfdu(16, 4:7) = dfdu(16, 4:7) - 0.5d0 * m(j) * c(j) * bm(:, j)
      dfdu(16, 11:14) = dfdu(16, 11:14) + 0.5d0 * m(j) * c(j) * bq(:, j)
    end if
  end do
  ! - d (d3/dq)^T n / dq, d3 being quadratic in q
  dfdu(11, 6) = dfdu(11, 6) - 2d0 * n(1)
  dfdu(11, 7) = dfdu(11, 7) + 2d0 * n(2)
  dfdu(11, 4) = dfdu(11, 4) + 2d0 * n(3)
  dfdu(12, 7) = dfdu(12, 7) - 2d0 * n(1)
  dfdu(12, 6) = dfdu(12, 6) - 2d0 * n(2)
  dfdu(12, 5) = dfdu(12, 5) + 2d0 * n(3)
  dfdu(13, 4) = dfdu(13, 4) - 2d0 * n(1)
  dfdu(13, 5) = dfdu(13, 5) - 2d0 * n(2)
  dfdu(13, 6) = dfdu(13, 6) - 2d0 * n(3)
  dfdu(14, 5) = dfdu(14, 5) - 2d0 * n(1)
  dfdu(14, 4) = dfdu(14, 4) + 2d0 * n(2)
  dfdu(14, 7) = dfdu(14, 7) - 2d0 * n(3)
  if (ijac == 2) dfdp(:, 1) = 0d0
end subroutine func

subroutine stpnt(ndim, u, par, t)
  use rod_data
  implicit none
  integer, intent(in) :: ndim
  double precision, intent(inout) :: u(ndim), par(*)
  double precision, intent(in) :: t
  call load()
  u(1:15) = start(:, nint(t * (n_rows - 1)))
  if (ndim > 15) u(16) = 0d0
  par(1) = start_alpha
  par(2) = 0d0
  par(3) = 0d0
  par(4) = k1
  par(5) = k3
end subroutine stpnt

subroutine bcnd(ndim, par, icp, nbc, u0, u1, fb, ijac, dbc)
  implicit none
  integer, intent(in) :: ndim, icp(*), nbc, ijac
  double precision, intent(in) :: par(*), u0(ndim), u1(ndim)
  double precision, intent(out) :: fb(nbc)
  double precision, intent(inout) :: dbc(nbc, *)
  integer :: i
  fb(1:3) = u0(1:3)
  fb(4:6) = u1(1:3)
  fb(7:9) = u0(4:6)
  fb(10) = u0(14)
  fb(11) = u1(4)
  fb(12) = u1(5)
  fb(13) = u1(6) + sin(0.5d0 * par(1))
  fb(14) = u1(7) + cos(0.5d0 * par(1))
  fb(15) = u0(15)
  if (nbc > 15) fb(16) = u0(16)
  if (ijac == 0) return
  dbc(:, 1:2 * ndim + 1) = 0d0
  do i = 1, 3
    dbc(i, i) = 1d0
    dbc(3 + i, ndim + i) = 1d0
    dbc(6 + i, 3 + i) = 1d0
  end do
  dbc(10, 14) = 1d0
  do i = 1, 4
    dbc(10 + i, ndim + 3 + i) = 1d0
  end do
  dbc(15, 15) = 1d0
  if (nbc > 15) dbc(16, 16) = 1d0
  dbc(13, 2 * ndim + 1) = 0.5d0 * cos(0.5d0 * par(1))
  dbc(14, 2 * ndim + 1) = -0.5d0 * sin(0.5d0 * par(1))
end subroutine bcnd

subroutine icnd()
end subroutine icnd

subroutine fopt()
end subroutine fopt

subroutine pvls(ndim, u, par)
  implicit none
  integer, intent(in) :: ndim
  double precision, intent(in) :: u(ndim)
  double precision, intent(inout) :: par(*)
  double precision, external :: getp
  ! m3(0) = mu3(0)/2 because q(0) = (0, 0, 0, 1)
  par(3) = 0.5d0 * getp('BV0', 13, u)
  if (ndim > 15) par(2) = getp('BV1', 16, u)
end subroutine pvls
